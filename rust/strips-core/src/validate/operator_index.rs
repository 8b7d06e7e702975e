//! From the bytes of a step to its operator, at the price of one hash and one comparison.
//!
//! The standard map costs 37 ns a step, most of it hashing. Here eight bytes are mixed at a time, folded to lower case by
//! one bit (which may confuse some characters; the comparison afterwards does not), and an open table of half its size is
//! probed in order. A step that is spelt with other spaces than one is not found: the slow way reads it.

use crate::task::{OperatorId, Task};

/// All operators of a task by name.
pub(super) struct OperatorIndex {
    /// All names, one after another, without parentheses.
    names: Vec<u8>,
    /// Where the name of each operator begins, and of the last one ends.
    starts: Vec<u32>,
    /// (upper half of the hash, operator + 1); 0 where empty. Its length is a power of two.
    table: Vec<(u32, u32)>,
}

impl OperatorIndex {
    pub(super) fn new(task: &Task) -> Self {
        let size = (task.operators.len() * 2).next_power_of_two().max(2);
        let mut index = Self { names: Vec::new(), starts: vec![0], table: vec![(0, 0); size] };
        for id in 0..task.operators.len() {
            let name = task.operator_name(OperatorId::from(id));
            index.names.extend_from_slice(&name.as_bytes()[1..name.len() - 1]);
            index.starts.push(index.names.len() as u32);
            index.insert(id);
        }
        index
    }

    fn insert(&mut self, id: usize) {
        let hash = hash(self.name(id));
        let mask = self.table.len() - 1;
        let mut slot = hash as usize & mask;
        while self.table[slot].1 != 0 {
            slot = (slot + 1) & mask;
        }
        self.table[slot] = ((hash >> 32) as u32, id as u32 + 1);
    }

    fn name(&self, id: usize) -> &[u8] {
        &self.names[self.starts[id] as usize..self.starts[id + 1] as usize]
    }

    /// The operator whose name, without parentheses, is `words`, in any case.
    pub(super) fn find(&self, words: &[u8]) -> Option<u32> {
        let hash = hash(words);
        let mask = self.table.len() - 1;
        let mut slot = hash as usize & mask;
        loop {
            let (tag, id) = self.table[slot];
            if id == 0 {
                return None;
            }
            if tag == (hash >> 32) as u32 && self.is_named(id as usize - 1, words) {
                return Some(id - 1);
            }
            slot = (slot + 1) & mask;
        }
    }

    fn is_named(&self, id: usize, words: &[u8]) -> bool {
        let name = self.name(id);
        name == words || name.eq_ignore_ascii_case(words)
    }
}

const CASE_BITS: u64 = 0x2020_2020_2020_2020;

fn hash(words: &[u8]) -> u64 {
    let mut chunks = words.chunks_exact(8);
    let mut hash = words.len() as u64;
    for chunk in &mut chunks {
        hash = mix(hash, u64::from_le_bytes(chunk.try_into().expect("a chunk has eight bytes")));
    }
    let rest = chunks.remainder().iter().fold(0, |word, &byte| word << 8 | u64::from(byte));
    let hash = mix(hash, rest);
    hash ^ (hash >> 32)
}

/// Multiplies to 128 bits and folds (the mixing step of wyhash, Wang Yi).
fn mix(hash: u64, word: u64) -> u64 {
    let product = u128::from(hash ^ (word | CASE_BITS)) * 0x9E37_79B9_7F4A_7C15_u128;
    (product as u64) ^ (product >> 64) as u64
}
