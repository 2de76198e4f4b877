//! Numbers by key for one search after the other: open addressing, emptied by counting on.

/// No number is known.
pub const NONE: u32 = u32::MAX;

/// Slots at the beginning.
const LEAST_SLOTS: usize = 1 << 12;

/// A number per key, as the states that a search has met by where and when they are.
#[derive(Debug, Clone, Default)]
pub struct Known {
    slots: Vec<Slot>,
    filled: usize,
    search: u32,
}

#[derive(Debug, Clone, Copy, Default)]
struct Slot {
    key: u64,
    number: u32,
    /// Number of the search that filled the slot.
    search: u32,
}

impl Known {
    /// A search begins, and nothing is known.
    pub fn begin(&mut self) {
        self.filled = 0;
        if self.slots.is_empty() || self.search == u32::MAX {
            self.slots = vec![Slot::default(); self.slots.len().max(LEAST_SLOTS)];
            self.search = 0;
        }
        self.search += 1;
    }

    /// The number of a key; [`NONE`] where there was none.
    #[inline]
    pub fn entry(&mut self, key: u64) -> &mut u32 {
        if self.filled * 2 >= self.slots.len() {
            self.grow();
        }
        let at = self.find(key);
        let slot = &mut self.slots[at];
        if slot.search != self.search {
            *slot = Slot {
                key,
                number: NONE,
                search: self.search,
            };
            self.filled += 1;
        }
        &mut slot.number
    }

    #[inline]
    fn find(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let bits = self.slots.len().trailing_zeros();
        let mut at = (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - bits)) as usize;
        while self.slots[at].search == self.search && self.slots[at].key != key {
            at = (at + 1) & mask;
        }
        at
    }

    #[cold]
    fn grow(&mut self) {
        // No search has the number 0, which empty slots have.
        self.search = self.search.max(1);
        let bigger = vec![Slot::default(); (self.slots.len() * 2).max(LEAST_SLOTS)];
        for slot in std::mem::replace(&mut self.slots, bigger) {
            if slot.search == self.search {
                let at = self.find(slot.key);
                self.slots[at] = slot;
            }
        }
    }
}
