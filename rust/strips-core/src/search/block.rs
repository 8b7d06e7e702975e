//! The successors of a block of states, between their making and their numbering.
//!
//! A batch holds the candidates of a run of states, sorted by shard of the state table; each shard then looks its own
//! candidates up, in candidate order, without locks, and notes what it finds new.

use std::sync::atomic::{AtomicU32, Ordering};

use super::exploration::NOWHERE;
use super::state_table::{FRESH, SHARDS, Shard, shard_of};

/// The successors of a run of states, before they are looked up.
pub(super) struct Batch {
    pub words: Vec<u64>,
    pub hashes: Vec<u64>,
    /// Candidates of each parent, as where they end.
    pub ends: Vec<u32>,
    /// Candidates sorted by shard; those of shard `s` are `order[starts[s]..starts[s + 1]]`.
    pub order: Vec<u32>,
    pub starts: [u32; SHARDS + 1],
    pub targets: Vec<AtomicU32>,
    /// Candidates of the batches before.
    pub base: u32,
}

/// What a shard found new in a block: candidate numbers and slots, and the states.
#[derive(Default)]
pub(super) struct Fresh {
    pub places: Vec<(u32, usize)>,
    pub words: Vec<u64>,
}

/// The hash of a candidate that is not kept; `hash_words` never returns it.
pub(super) const DROPPED: u64 = 0;

impl Batch {
    /// Room for about this many candidates.
    pub fn new(candidates: usize, width: usize) -> Self {
        Self {
            words: Vec::with_capacity(candidates * width),
            hashes: Vec::with_capacity(candidates),
            ends: Vec::new(),
            order: Vec::new(),
            starts: [0; SHARDS + 1],
            targets: Vec::new(),
            base: 0,
        }
    }

    /// A counting sort of the kept candidates.
    pub fn sort_by_shard(&mut self) {
        let kept = |&(_, &hash): &(usize, &u64)| hash != DROPPED;
        for (_, &hash) in self.hashes.iter().enumerate().filter(kept) {
            self.starts[shard_of(hash) + 1] += 1;
        }
        (0..SHARDS).for_each(|shard| self.starts[shard + 1] += self.starts[shard]);
        let mut next = self.starts;
        self.order = vec![0; self.starts[SHARDS] as usize];
        for (candidate, &hash) in self.hashes.iter().enumerate().filter(kept) {
            let place = &mut next[shard_of(hash)];
            self.order[*place as usize] = candidate as u32;
            *place += 1;
        }
        self.targets = self.hashes.iter().map(|_| AtomicU32::new(NOWHERE)).collect();
    }

    fn of_shard(&self, shard: usize) -> &[u32] {
        &self.order[self.starts[shard] as usize..self.starts[shard + 1] as usize]
    }
}

/// Looks up the candidates of one shard in order, adding those that are new.
pub(super) fn look_up_shard<const W: usize>(
    index: usize,
    shard: &mut Shard,
    batches: &[Batch],
    states: &[u64],
    width: usize,
) -> Fresh {
    let width = if W == 0 { width } else { W };
    let mut fresh = Fresh::default();
    shard.reserve(batches.iter().map(|batch| batch.of_shard(index).len()).sum());
    for batch in batches {
        for &candidate in batch.of_shard(index) {
            let hash = batch.hashes[candidate as usize];
            let words = &batch.words[candidate as usize * width..][..width];
            let target = match shard.find(hash, |known| stored(known, states, &fresh.words, width) == words) {
                Ok(known) if known & FRESH != 0 => FRESH | fresh.places[(known & !FRESH) as usize].0,
                Ok(known) => known,
                Err(place) => fresh.add(shard, place, hash, words, batch.base + candidate),
            };
            batch.targets[candidate as usize].store(target, Ordering::Relaxed);
        }
    }
    fresh
}

/// The packed state of a number, which may be one of this block's.
#[inline]
fn stored<'a>(number: u32, states: &'a [u64], fresh: &'a [u64], width: usize) -> &'a [u64] {
    if number & FRESH != 0 {
        &fresh[(number & !FRESH) as usize * width..][..width]
    } else {
        &states[number as usize * width..][..width]
    }
}

impl Fresh {
    fn add(&mut self, shard: &mut Shard, place: usize, hash: u64, words: &[u64], candidate: u32) -> u32 {
        shard.insert(place, hash, FRESH | self.places.len() as u32);
        self.places.push((candidate, place));
        self.words.extend_from_slice(words);
        FRESH | candidate
    }
}
