//! Layered breadth-first search over packed states, in parallel, numbering states as one thread would.
//!
//! States are numbered in the order of first discovery: by layer, then by the parent's number, then by operator. The
//! frontier is expanded in blocks. A small block is expanded state by state. A large one goes through three phases:
//! threads expand batches of states and sort the candidates by shard; threads look the candidates up, a shard each,
//! in candidate order; the new ones are then numbered in candidate order. The result depends on neither the number of
//! threads nor the sizes of blocks and batches.
//!
//! Price: the packed state and 11 to 21 bytes of table a state; the links, where wanted, 4 bytes an operator
//! application and 8 a state. The width `W` in words is known to the compiler up to four words; `W = 0` stands for more.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;

use super::block::{Batch, DROPPED, Fresh, look_up_shard};
use super::goal_bound::GoalBound;
use super::state_table::{FRESH, Shard, StateTable, hash_words, shard_of};
use super::successor_generator::SuccessorGenerator;
use crate::task::{LimitError, Watch};

/// Stands in links for a successor that was not kept.
pub(super) const NOWHERE: u32 = u32::MAX;

/// How far and how to explore.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scope {
    /// Steps from the initial state; states that cannot reach the goal within them may be left out.
    pub horizon: Option<usize>,
    /// Whether states that satisfy the goal have successors.
    pub expand_goals: bool,
    /// Whether to remember which state each operator application leads to.
    pub links: bool,
    /// Whether to stop at the first state that satisfies the goal.
    pub stop_at_goal: bool,
    /// Blocks with fewer candidates than about this are expanded one by one.
    pub serial_below: usize,
}

/// For each state, where its applicable operators (ascending) lead.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    /// Where each expanded state's targets end.
    pub ends: Vec<u64>,
    /// State numbers or [`NOWHERE`].
    pub targets: Vec<u32>,
}

impl Links {
    /// The targets of a state; none for a state that was not expanded.
    #[inline]
    pub fn of(&self, state: usize) -> &[u32] {
        let end = |at: usize| self.ends.get(at).copied().unwrap_or(self.targets.len() as u64) as usize;
        let first = if state == 0 { 0 } else { end(state - 1) };
        &self.targets[first..end(state)]
    }
}

/// What a search found.
#[derive(Clone, Debug)]
pub(super) struct Explored {
    /// Packed states, one after the other.
    pub states: Vec<u64>,
    pub table: StateTable,
    /// The number of the first state of each layer, and then the number of states.
    pub layers: Vec<u32>,
    pub links: Links,
    /// The state from which each was first reached, if the search was to stop at a goal.
    pub parents: Vec<u32>,
    /// The first goal state, if the search was to stop there.
    pub goal: Option<u32>,
}

/// Explores from one packed state or several, one after the other in `roots`.
pub(super) fn explore(
    generator: &SuccessorGenerator,
    bound: &GoalBound,
    roots: &[u64],
    scope: Scope,
    watch: &Watch,
) -> Result<Explored, LimitError> {
    let width = generator.width();
    match width {
        1 => Explorer::<1>::new(generator, bound, scope, watch, width).run(roots),
        2 => Explorer::<2>::new(generator, bound, scope, watch, width).run(roots),
        3 => Explorer::<3>::new(generator, bound, scope, watch, width).run(roots),
        4 => Explorer::<4>::new(generator, bound, scope, watch, width).run(roots),
        _ => Explorer::<0>::new(generator, bound, scope, watch, width).run(roots),
    }
}

/// A search under way.
struct Explorer<'a, const W: usize> {
    generator: &'a SuccessorGenerator,
    bound: &'a GoalBound,
    scope: Scope,
    watch: &'a Watch,
    width: usize,
    found: Explored,
}

/// Buffers of the serial expansion.
struct Room {
    current: Vec<u64>,
    next: Vec<u64>,
    applicable: Vec<u32>,
}

impl<'a, const W: usize> Explorer<'a, W> {
    fn new(
        generator: &'a SuccessorGenerator,
        bound: &'a GoalBound,
        scope: Scope,
        watch: &'a Watch,
        width: usize,
    ) -> Self {
        let (states, table) = (Vec::new(), StateTable::new());
        let found =
            Explored { states, table, layers: vec![0], links: Links::default(), parents: Vec::new(), goal: None };
        Self { generator, bound, scope, watch, width, found }
    }

    /// Words a state, a constant where the compiler can use it.
    #[inline]
    fn width(&self) -> usize {
        if W == 0 { self.width } else { W }
    }

    fn len(&self) -> usize {
        self.found.states.len() / self.width()
    }

    fn run(mut self, roots: &[u64]) -> Result<Explored, LimitError> {
        for root in roots.chunks_exact(self.width()) {
            if self.keeps(root, self.scope.horizon) {
                self.find_or_add(root, 0);
            }
        }
        let mut depth = 0;
        while self.found.layers.last() != Some(&(self.len() as u32)) && !self.is_done() {
            let (from, to) = (self.found.layers.last().map_or(0, |&first| first as usize), self.len());
            self.found.layers.push(to as u32);
            if self.scope.horizon.is_none_or(|horizon| depth < horizon) {
                self.expand_layer(from, to, self.scope.horizon.map(|horizon| horizon - depth - 1))?;
            }
            depth += 1;
        }
        Ok(self.found)
    }

    fn is_done(&self) -> bool {
        self.found.goal.is_some()
    }

    /// Expands the states `from..to`; their successors have `remaining` steps left.
    fn expand_layer(&mut self, from: usize, to: usize, remaining: Option<usize>) -> Result<(), LimitError> {
        const CANDIDATES: usize = 1 << 18;
        let mut first = from;
        while first < to && !self.is_done() {
            let branching = self.branching(first);
            let last = to.min(first + (CANDIDATES / branching).max(1));
            if (last - first) * branching < self.scope.serial_below {
                self.expand_serially(first..last, remaining)?;
            } else {
                self.expand_block(first..last, branching, remaining)?;
            }
            self.check_limits()?;
            first = last;
        }
        Ok(())
    }

    /// A guess at the operators that a state of this neighbourhood allows, to bound what a block holds.
    fn branching(&self, state: usize) -> usize {
        let mut applicable = Vec::new();
        self.generator.applicable_in(&self.found.states[state * self.width()..][..self.width()], &mut applicable);
        applicable.len().max(8)
    }

    fn check_limits(&self) -> Result<(), LimitError> {
        const MOST: usize = (FRESH >> 1) as usize;
        self.watch.check()?;
        self.watch.states(self.len())?;
        if self.len() > MOST {
            return Err(LimitError::States { limit: MOST });
        }
        let links = self.found.links.targets.len() * 4 + self.found.links.ends.len() * 8;
        self.watch.bytes(self.found.states.len() * 8 + self.found.table.bytes() + links)
    }

    /// Whether successors with these words are worth keeping.
    #[inline]
    fn keeps(&self, words: &[u64], remaining: Option<usize>) -> bool {
        remaining.is_none_or(|remaining| self.bound.within(words, remaining))
    }

    #[inline]
    fn is_expanded(&self, words: &[u64]) -> bool {
        self.scope.expand_goals || !self.bound.is_goal(words)
    }

    // One by one.

    fn expand_serially(&mut self, block: std::ops::Range<usize>, remaining: Option<usize>) -> Result<(), LimitError> {
        let mut room = Room { current: vec![0; self.width()], next: vec![0; self.width()], applicable: Vec::new() };
        let mut since_check = 0;
        for state in block {
            since_check += 1 + room.applicable.len();
            if since_check > 1 << 14 {
                self.watch.check()?;
                since_check = 0;
            }
            self.expand_state(state, remaining, &mut room);
            if self.is_done() {
                break;
            }
        }
        Ok(())
    }

    fn expand_state(&mut self, state: usize, remaining: Option<usize>, room: &mut Room) {
        let Room { current, next, applicable } = room;
        current.copy_from_slice(&self.found.states[state * self.width()..][..self.width()]);
        applicable.clear();
        if self.is_expanded(current) {
            self.generator.applicable_in(current, applicable);
        }
        for &operator in applicable.iter() {
            next.copy_from_slice(current);
            self.generator.apply(operator, current, next);
            let target = if self.keeps(next, remaining) { self.find_or_add(next, state as u32) } else { NOWHERE };
            if self.scope.links {
                self.found.links.targets.push(target);
            }
        }
        if self.scope.links {
            self.found.links.ends.push(self.found.links.targets.len() as u64);
        }
    }

    fn find_or_add(&mut self, words: &[u64], parent: u32) -> u32 {
        let (hash, number, width) = (hash_words(words), self.len() as u32, self.width());
        let Explored { states, table, .. } = &mut self.found;
        let shard = &mut table.shards[shard_of(hash)];
        shard.reserve(1);
        match shard.find(hash, |known| states[known as usize * width..][..width] == *words) {
            Ok(known) => known,
            Err(place) => {
                shard.insert(place, hash, number);
                self.add(words, parent);
                number
            }
        }
    }

    /// Appends a state that was first reached from `parent`.
    fn add(&mut self, words: &[u64], parent: u32) {
        if self.scope.stop_at_goal {
            self.found.parents.push(parent);
            if self.found.goal.is_none() && self.bound.is_goal(words) {
                self.found.goal = Some(self.len() as u32);
            }
        }
        self.found.states.extend_from_slice(words);
    }

    // In blocks.

    fn expand_block(
        &mut self,
        block: std::ops::Range<usize>,
        branching: usize,
        remaining: Option<usize>,
    ) -> Result<(), LimitError> {
        let (first, size) = (block.start, (2048 / branching).max(1));
        let starts: Vec<usize> = block.clone().step_by(size).collect();
        let batch = |&at: &usize| self.expand_batch(at..block.end.min(at + size), remaining);
        let mut batches = starts.par_iter().map(batch).collect::<Result<Vec<_>, _>>()?;
        let mut candidates = 0;
        for batch in &mut batches {
            batch.base = candidates;
            candidates += batch.hashes.len() as u32;
        }
        let fresh = self.look_up(&batches);
        let numbers = self.number(&batches, candidates as usize, first as u32);
        self.renumber(&fresh, &numbers);
        if self.scope.links {
            self.link(&batches, &numbers);
        }
        Ok(())
    }

    fn expand_batch(&self, states: std::ops::Range<usize>, remaining: Option<usize>) -> Result<Batch, LimitError> {
        self.watch.check()?;
        let mut batch = Batch::new(states.len() * 8, self.width());
        let mut applicable = Vec::new();
        for state in states {
            let words = &self.found.states[state * self.width()..][..self.width()];
            if self.is_expanded(words) {
                self.generator.applicable_in(words, &mut applicable);
                for &operator in &applicable {
                    self.add_candidate(&mut batch, operator, words, remaining);
                }
            }
            batch.ends.push(batch.hashes.len() as u32);
        }
        batch.sort_by_shard();
        Ok(batch)
    }

    #[inline]
    fn add_candidate(&self, batch: &mut Batch, operator: u32, words: &[u64], remaining: Option<usize>) {
        let at = batch.words.len();
        batch.words.extend_from_slice(words);
        self.generator.apply(operator, words, &mut batch.words[at..][..self.width()]);
        let next = &batch.words[at..][..self.width()];
        if self.keeps(next, remaining) {
            batch.hashes.push(hash_words(next));
        } else if self.scope.links {
            batch.hashes.push(DROPPED);
        } else {
            batch.words.truncate(at);
        }
    }

    /// Looks up every candidate, shard by shard; a new state's target is its own candidate number, flagged.
    fn look_up(&mut self, batches: &[Batch]) -> Vec<Fresh> {
        let width = self.width();
        let Explored { states, table, .. } = &mut self.found;
        let states = states.as_slice();
        let one = |(index, shard): (usize, &mut Shard)| look_up_shard::<W>(index, shard, batches, states, width);
        table.shards.par_iter_mut().enumerate().map(one).collect()
    }

    /// Numbers the new states in candidate order and appends them; the numbers by candidate.
    fn number(&mut self, batches: &[Batch], candidates: usize, first: u32) -> Vec<u32> {
        let (mut numbers, width, mut parent) = (vec![0; candidates], self.width(), first);
        for batch in batches {
            let mut start = 0;
            for &end in &batch.ends {
                for candidate in start as usize..end as usize {
                    let own = batch.base + candidate as u32;
                    if batch.targets[candidate].load(Ordering::Relaxed) == FRESH | own {
                        numbers[own as usize] = self.len() as u32;
                        self.add(&batch.words[candidate * width..][..width], parent);
                    }
                }
                (start, parent) = (end, parent + 1);
            }
        }
        numbers
    }

    fn renumber(&mut self, fresh: &[Fresh], numbers: &[u32]) {
        let one = |(shard, fresh): (&mut Shard, &Fresh)| {
            fresh.places.iter().for_each(|&(candidate, place)| shard.renumber(place, numbers[candidate as usize]));
        };
        self.found.table.shards.par_iter_mut().zip(fresh).for_each(one);
    }

    fn link(&mut self, batches: &[Batch], numbers: &[u32]) {
        let links = &mut self.found.links;
        let resolve = |target: &AtomicU32| match target.load(Ordering::Relaxed) {
            NOWHERE => NOWHERE,
            target if target & FRESH != 0 => numbers[(target & !FRESH) as usize],
            target => target,
        };
        for batch in batches {
            let base = links.targets.len() as u64;
            links.targets.extend(batch.targets.iter().map(resolve));
            links.ends.extend(batch.ends.iter().map(|&end| base + u64::from(end)));
        }
    }
}
