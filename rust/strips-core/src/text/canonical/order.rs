//! The order of declaration of objects, as far as sorted rows of atoms tell it.

use super::packed::Packed;

/// A rank for each of `slots` objects, such that the rows ascend by (predicate, ranks) where that is possible.
///
/// Two neighbours of one predicate say that the first object in which they differ comes earlier in the former. What
/// contradicts earlier neighbours is passed over. Where nothing is said, the order of slots decides. Price: the cube of
/// the number of objects at worst, paid only where the order of slots does not fit as it is.
pub(super) fn ranks_from<'a>(
    slots: usize,
    arity: impl Fn(u16) -> usize,
    rows: impl Iterator<Item = &'a [Packed]> + Clone,
) -> Vec<u16> {
    if rows.clone().all(<[Packed]>::is_sorted) {
        return Vec::new();
    }
    let mut before = Precedence::new(slots);
    for pair in rows.flat_map(|row| row.windows(2)) {
        if pair[0].predicate() == pair[1].predicate() {
            let differing = (0..arity(pair[0].predicate())).find(|&i| pair[0].arg(i) != pair[1].arg(i));
            if let Some(i) = differing {
                before.add(usize::from(pair[0].arg(i)), usize::from(pair[1].arg(i)));
            }
        }
    }
    before.ranks()
}

/// A transitively closed partial order; `later[a]` are the bits of everything after `a`.
struct Precedence {
    slots: usize,
    later: Vec<Vec<u64>>,
}

impl Precedence {
    fn new(slots: usize) -> Self {
        Self { slots, later: vec![vec![0; slots.div_ceil(64)]; slots] }
    }

    fn is_before(&self, a: usize, b: usize) -> bool {
        self.later[a][b / 64] >> (b % 64) & 1 == 1
    }

    fn add(&mut self, a: usize, b: usize) {
        if self.is_before(a, b) || self.is_before(b, a) {
            return;
        }
        let mut after = self.later[b].clone();
        after[b / 64] |= 1 << (b % 64);
        for earlier in 0..self.slots {
            if earlier == a || self.is_before(earlier, a) {
                self.later[earlier].iter_mut().zip(&after).for_each(|(word, &more)| *word |= more);
            }
        }
    }

    /// The smallest slot that has nothing unranked before it gets the next rank.
    fn ranks(&self) -> Vec<u16> {
        let mut ranks = vec![u16::MAX; self.slots];
        for rank in 0..self.slots {
            let free = |slot: usize, ranks: &[u16]| {
                ranks[slot] == u16::MAX && !(0..self.slots).any(|s| ranks[s] == u16::MAX && self.is_before(s, slot))
            };
            let next = (0..self.slots).find(|&slot| free(slot, &ranks)).expect("a partial order has a least element");
            ranks[next] = rank as u16;
        }
        ranks
    }
}

/// The ranks of slots named `names` where objects are declared as in `declared`; others come last, in slot order.
pub(super) fn ranks_by_names(names: &[&str], declared: &[String]) -> Vec<u16> {
    let place = |slot: &usize| declared.iter().position(|name| name == names[*slot]).unwrap_or(usize::MAX);
    let mut slots: Vec<usize> = (0..names.len()).collect();
    slots.sort_by_key(place);
    if slots.is_sorted() {
        return Vec::new();
    }
    let mut ranks = vec![0; names.len()];
    slots.iter().enumerate().for_each(|(rank, &slot)| ranks[slot] = rank as u16);
    ranks
}
