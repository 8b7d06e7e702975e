//! An open-addressing table from states to their numbers, in shards that threads fill without locks.
//!
//! A slot holds 32 bits of the state's hash and its number plus one; the states themselves lie elsewhere. The place of
//! a slot is the top of those same bits, so a shard grows by spreading its slots out, without looking at any state.
//! Price: 8 bytes a slot, at most three of four slots taken: 11 to 21 bytes a state.

/// Shards of a table: enough for the threads of any machine that this is meant for, few enough to start cheaply.
pub(super) const SHARDS: usize = 32;

/// Set in numbers that stand for a state found in the current block, before it has its final number.
pub(super) const FRESH: u32 = 1 << 31;

/// All shards.
#[derive(Clone, Debug)]
pub(super) struct StateTable {
    pub shards: Vec<Shard>,
}

/// The part of the table for states whose hash ends in the shard's number.
#[derive(Clone, Debug, Default)]
pub(super) struct Shard {
    slots: Vec<u64>,
    shift: u32,
    len: usize,
}

impl StateTable {
    pub fn new() -> Self {
        Self { shards: vec![Shard::default(); SHARDS] }
    }

    /// Bytes that the slots take.
    pub fn bytes(&self) -> usize {
        self.shards.iter().map(|shard| shard.slots.len() * 8).sum()
    }
}

impl Shard {
    /// Makes room for `more` states, so that no slot moves until they are inserted.
    pub fn reserve(&mut self, more: usize) {
        let wanted = ((self.len + more) * 4 / 3 + 1).next_power_of_two().max(8);
        if wanted > self.slots.len() {
            self.grow(wanted);
        }
    }

    fn grow(&mut self, slots: usize) {
        let old = std::mem::replace(&mut self.slots, vec![0; slots]);
        self.shift = 64 - slots.trailing_zeros();
        for slot in old.into_iter().filter(|&slot| slot != 0) {
            let place = self.free_place(slot);
            self.slots[place] = slot;
        }
    }

    fn free_place(&self, slot: u64) -> usize {
        let mut place = self.home(slot);
        while self.slots[place] != 0 {
            place = (place + 1) & (self.slots.len() - 1);
        }
        place
    }

    #[inline]
    fn home(&self, hash: u64) -> usize {
        (hash >> self.shift) as usize
    }

    /// The number of the state with this hash for which `same` is true, or the free slot where it belongs.
    #[inline]
    pub fn find(&self, hash: u64, mut same: impl FnMut(u32) -> bool) -> Result<u32, usize> {
        if self.slots.is_empty() {
            return Err(0);
        }
        let mut place = self.home(hash);
        loop {
            let slot = self.slots[place];
            if slot == 0 {
                return Err(place);
            }
            if (slot ^ hash) >> 32 == 0 && same(slot as u32 - 1) {
                return Ok(slot as u32 - 1);
            }
            place = (place + 1) & (self.slots.len() - 1);
        }
    }

    /// Puts a number into the free slot that [`Self::find`] named.
    #[inline]
    pub fn insert(&mut self, place: usize, hash: u64, number: u32) {
        self.slots[place] = hash >> 32 << 32 | u64::from(number + 1);
        self.len += 1;
    }

    /// Replaces the number in a taken slot.
    #[inline]
    pub fn renumber(&mut self, place: usize, number: u32) {
        self.slots[place] = self.slots[place] >> 32 << 32 | u64::from(number + 1);
    }
}

/// The shard that keeps states with this hash.
#[inline]
pub(super) fn shard_of(hash: u64) -> usize {
    hash as usize % SHARDS
}

/// Hash of a packed state, never 0: folded 128-bit products, as in wyhash.
#[inline]
pub(super) fn hash_words(words: &[u64]) -> u64 {
    let mix = |hash: u64, &word: &u64| fold(u128::from(hash ^ word) * 0xA076_1D64_78BD_642F);
    let hash = words.iter().fold(0x9E37_79B9_7F4A_7C15, mix);
    fold(u128::from(hash ^ 0xE703_7ED1_A0B4_28DB) * 0x8EBC_6AF0_9C88_C6E3).max(1)
}

#[inline]
fn fold(product: u128) -> u64 {
    (product >> 64) as u64 ^ product as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_finds_what_was_put_in_through_every_growth() {
        let mut shard = Shard::default();
        for number in 0..10_000u32 {
            let hash = hash_words(&[u64::from(number)]);
            shard.reserve(1);
            let place = shard.find(hash, |n| n == number).expect_err("not yet there");
            shard.insert(place, hash, number);
        }
        for number in 0..10_000u32 {
            assert_eq!(shard.find(hash_words(&[u64::from(number)]), |n| n == number), Ok(number));
        }
    }
}
