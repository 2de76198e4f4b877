//! Lists of different lengths in two flat arrays, as the C structures have them.

use std::fmt;
use std::ops::{Index, Range};

use schemars::JsonSchema;
use serde::de::{DeserializeSeed, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// Lists of different lengths, stored flat: list `i` is `items[offsets[i]..offsets[i + 1]]`.
/// On the wire a list of lists.
///
/// ```
/// use fleetyard_abi::Lists;
///
/// let lists: Lists<u32> = [vec![4, 1], vec![], vec![7]].into_iter().collect();
/// assert_eq!((lists.len(), lists.offsets(), lists.items()), (3, &[0, 2, 2, 3][..], &[4, 1, 7][..]));
/// assert_eq!(lists[0], [4, 1]);
/// assert_eq!(Lists::from_flat(vec![0, 2, 2, 3], vec![4, 1, 7]), Some(lists));
/// assert_eq!(Lists::from_flat(vec![0, 2], vec![4, 1, 7]), None);
/// ```
///
/// A list can also be written item by item: [`Lists::push_item`], then [`Lists::end_list`].
/// Items of a list that has not ended belong to none of the lists.
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Lists<T> {
    offsets: Vec<u64>,
    items: Vec<T>,
}

impl<T: fmt::Debug> fmt::Debug for Lists<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self::with_capacity(0, 0)
    }
}

impl<T> Lists<T> {
    /// No lists, but room for so many with so many items together.
    pub fn with_capacity(lists: usize, items: usize) -> Self {
        let mut offsets = Vec::with_capacity(lists.saturating_add(1));
        offsets.push(0);
        Self {
            offsets,
            items: Vec::with_capacity(items),
        }
    }

    /// From flat arrays; `None` when the offsets do not begin with 0, decrease, or do not end
    /// with the number of items.
    pub fn from_flat(offsets: Vec<u64>, items: Vec<T>) -> Option<Self> {
        let fit = offsets.first() == Some(&0)
            && offsets.last() == Some(&(items.len() as u64))
            && offsets.is_sorted();
        fit.then_some(Self { offsets, items })
    }

    /// Lists of one item each.
    pub fn single(items: Vec<T>) -> Self {
        Self {
            offsets: (0..=items.len() as u64).collect(),
            items,
        }
    }

    /// Appends a list.
    pub fn push(&mut self, list: impl IntoIterator<Item = T>) {
        self.items.extend(list);
        self.end_list();
    }

    /// Appends an item to the list that is being written.
    pub fn push_item(&mut self, item: T) {
        self.items.push(item);
    }

    /// Ends the list that is being written, which may be empty.
    pub fn end_list(&mut self) {
        self.offsets.push(self.items.len() as u64);
    }

    /// The items of the list that is being written.
    pub fn open_list(&mut self) -> &mut [T] {
        let begin = self.end_of(self.len());
        &mut self.items[begin..]
    }

    /// Takes back the list that is being written.
    pub fn drop_open_list(&mut self) {
        self.items.truncate(self.end_of(self.len()));
    }

    /// All items, the last ones those of the list that is being written: they may be appended
    /// to, and room that nobody needs given back.
    pub(crate) fn items_mut(&mut self) -> &mut Vec<T> {
        &mut self.items
    }

    /// Number of lists.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// True if there are no lists.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The items of a list, if there are so many lists.
    pub fn get(&self, index: usize) -> Option<&[T]> {
        (index < self.len()).then(|| &self[index])
    }

    /// The place of a list's items in [`Lists::items`]. The list must exist.
    pub fn range(&self, index: usize) -> Range<usize> {
        self.end_of(index)..self.end_of(index + 1)
    }

    /// Every list, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[T]> + DoubleEndedIterator {
        self.offsets
            .windows(2)
            .map(|range| &self.items[range[0] as usize..range[1] as usize])
    }

    /// Prefix sums of the lists' lengths: one more than there are lists.
    pub fn offsets(&self) -> &[u64] {
        &self.offsets
    }

    /// The items of all lists, one list after the other.
    pub fn items(&self) -> &[T] {
        &self.items[..self.end_of(self.len())]
    }

    /// Number of items in the first `lists` lists.
    fn end_of(&self, lists: usize) -> usize {
        self.offsets[lists] as usize
    }
}

/// The items of a list, which must exist.
impl<T> Index<usize> for Lists<T> {
    type Output = [T];

    fn index(&self, index: usize) -> &[T] {
        &self.items[self.range(index)]
    }
}

impl<T, L: IntoIterator<Item = T>> FromIterator<L> for Lists<T> {
    fn from_iter<I: IntoIterator<Item = L>>(lists: I) -> Self {
        let lists = lists.into_iter();
        let mut all = Self::with_capacity(lists.size_hint().0, 0);
        for list in lists {
            all.push(list);
        }
        all
    }
}

impl<T: Serialize> Serialize for Lists<T> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Lists<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut lists = Self::default();
        deserializer.deserialize_seq(ReadLists(&mut lists))?;
        Ok(lists)
    }
}

/// Reads lists into those that are there.
struct ReadLists<'a, T>(&'a mut Lists<T>);

/// Reads the items of one list.
struct ReadList<'a, T>(&'a mut Lists<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for ReadLists<'_, T> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut lists: A) -> Result<(), A::Error> {
        while lists.next_element_seed(ReadList(self.0))?.is_some() {}
        Ok(())
    }
}

impl<'de, T: Deserialize<'de>> DeserializeSeed<'de> for ReadList<'_, T> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: Deserialize<'de>> Visitor<'de> for ReadList<'_, T> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a sequence")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<(), A::Error> {
        while let Some(item) = items.next_element()? {
            self.0.push_item(item);
        }
        self.0.end_list();
        Ok(())
    }
}

/// Lists of cells: per agent its goals, in order.
pub type Goals = Lists<u32>;

impl JsonSchema for Goals {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Goals".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        Vec::<Vec<u32>>::json_schema(generator)
    }
}
