//! An entry per place that is as good as cleared when a call begins.

use crate::grid::Place;

/// Entries, each with the number of the call that wrote it.
#[derive(Debug)]
pub(crate) struct Slate<T> {
    entries: Vec<(u32, T)>,
    call: u32,
}

impl<T> Default for Slate<T> {
    fn default() -> Self {
        Self {
            entries: Vec::new(),
            call: 0,
        }
    }
}

impl<T: Copy + Default> Slate<T> {
    /// Forgets everything; `places` is the size of the map.
    pub(crate) fn begin(&mut self, places: usize) {
        if self.entries.len() != places || self.call == u32::MAX {
            self.entries = vec![(0, T::default()); places];
            self.call = 0;
        }
        self.call += 1;
    }

    /// The entry, if there is one.
    #[inline]
    pub(crate) fn get(&self, place: Place) -> Option<T> {
        let (call, entry) = self.entries[place as usize];
        (call == self.call).then_some(entry)
    }

    /// The entry, made if there is none.
    #[inline]
    pub(crate) fn entry(&mut self, place: Place) -> &mut T {
        let (call, entry) = &mut self.entries[place as usize];
        if *call != self.call {
            (*call, *entry) = (self.call, T::default());
        }
        entry
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_do_not_see_each_other() {
        let mut slate = Slate::default();
        for call in 1..5 {
            slate.begin(3);
            assert_eq!(slate.get(1), None);
            *slate.entry(1) += call;
            assert_eq!(slate.get(1), Some(call));
        }
        slate.call = u32::MAX;
        slate.begin(3);
        assert_eq!((slate.get(1), slate.call), (None, 1));
    }
}
