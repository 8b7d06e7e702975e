//! Causal self-attention for training, forward and backward, within rows of any length that lie one behind the other.
//!
//! Each head of each row is made by itself, a block of two registers' worth of queries at a time, so that all of its
//! numbers stay in the processor's first cache. Scores are laid out key after key with the lanes over queries: softmax
//! needs no sums across lanes. The way back makes the scores anew from each query's normaliser. Products of keys behind
//! a query are left out, and rows are not padded. What a row's numbers are depends on that row, and on those it shares
//! tokens with, alone: to the last bit.
//!
//! Rows that begin alike need that beginning once: a row may borrow the first tokens of one before it. It attends to them
//! as to its own, and what it gives their keys and values is added to what their own row does.

mod backward;
mod forward;
mod head;
mod products;

use std::ops::Range;
use std::{iter, thread};

use pulp::{Arch, Simd, WithSimd};

use crate::sheet::has_many_registers;
use backward::Backward;
use forward::Forward;

/// How a number is kept outside: `f32` as it is, `u16` as the upper half of one (bfloat16).
pub trait Number: Copy + Default + Send + Sync {
    /// The number.
    fn widen(self) -> f32;
    /// The nearest number that can be kept.
    fn narrow(number: f32) -> Self;
}

impl Number for f32 {
    #[inline(always)]
    fn widen(self) -> f32 {
        self
    }

    #[inline(always)]
    fn narrow(number: f32) -> Self {
        number
    }
}

impl Number for u16 {
    #[inline(always)]
    fn widen(self) -> f32 {
        f32::from_bits(u32::from(self) << 16)
    }

    /// To even where two are as near; what is no number stays none.
    #[inline(always)]
    fn narrow(number: f32) -> Self {
        let bits = number.to_bits();
        let nearest = (bits.wrapping_add(0x7fff + (bits >> 16 & 1)) >> 16) as u16;
        if number.is_nan() { 0x7fc0 } else { nearest }
    }
}

/// Which tokens attend to each other, and how.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// Where each row begins, ascending, and where the last one ends.
    pub bounds: &'a [usize],
    /// How many tokens each row has before its own: the first ones of the last row before it that borrows none. Empty where
    /// no row borrows any.
    pub borrowed: &'a [usize],
    /// Heads.
    pub heads: usize,
    /// Numbers in a head.
    pub size: usize,
    /// Factor of every score.
    pub scale: f32,
}

impl Rows<'_> {
    fn width(self) -> usize {
        self.heads * self.size
    }

    fn borrows(&self, row: usize) -> usize {
        self.borrowed.get(row).copied().unwrap_or(0)
    }

    /// Rows that borrow from none, each with those that borrow from it.
    fn families(&self) -> impl Iterator<Item = Range<usize>> {
        let rows = self.bounds.len().saturating_sub(1);
        let mut start = 0;
        iter::from_fn(move || {
            let borrowing = (start + 1..rows).take_while(|&row| self.borrows(row) > 0).count();
            let family = start..start + 1 + borrowing;
            start = family.end;
            (family.end <= rows).then_some(family)
        })
    }

    /// Stretches of whole families of about as many tokens each.
    fn stretches(&self, threads: usize) -> Vec<Self> {
        let rows = self.bounds.len().saturating_sub(1);
        let (Some(&first), Some(&last)) = (self.bounds.first(), self.bounds.last()) else { return Vec::new() };
        let mut stretches = Vec::new();
        let mut start = 0;
        for thread in 1..=threads {
            let goal = first + (last - first) * thread / threads;
            let within = self.bounds[start + 1..].iter().take_while(|&&bound| bound <= goal).count();
            let mut end = if thread == threads { rows } else { start + within };
            while end < rows && self.borrows(end) > 0 {
                end += 1;
            }
            if end > start {
                let borrowed = self.borrowed.get(start..end).unwrap_or_default();
                stretches.push(Self { bounds: &self.bounds[start..=end], borrowed, ..*self });
            }
            start = end;
        }
        stretches
    }
}

/// What every token attends to: of `parts`, (tokens, query and key and value, heads, size), into `mixed`, (tokens, heads,
/// size). `normalisers`, (tokens, heads), are the logarithms of the softmaxes' denominators, for the way back.
pub fn attend<N: Number>(rows: Rows<'_>, parts: &[N], mixed: &mut [N], normalisers: &mut [f32], threads: usize) {
    let mut mixed = Uncut { rest: mixed, reached: 0, across: rows.width() };
    let mut normalisers = Uncut { rest: normalisers, reached: 0, across: rows.heads };
    run_all(rows, threads, |rows| {
        let (mixed, normalisers) = (mixed.cut(rows.bounds), normalisers.cut(rows.bounds));
        Forward { rows, parts, mixed, normalisers }
    });
}

/// The gradient of `parts`, into `slopes`, where `grads` is that of what [`attend`] mixed.
pub fn attend_back<N: Number>(
    rows: Rows<'_>,
    parts: &[N],
    grads: &[N],
    normalisers: &[f32],
    slopes: &mut [N],
    threads: usize,
) {
    let mut slopes = Uncut { rest: slopes, reached: 0, across: 3 * rows.width() };
    run_all(rows, threads, |rows| Backward { rows, parts, grads, normalisers, slopes: slopes.cut(rows.bounds) });
}

/// A table of tokens, of which each stretch of rows gets its own to write.
struct Uncut<'a, T> {
    rest: &'a mut [T],
    /// The token that `rest` begins with.
    reached: usize,
    /// Numbers from token to token.
    across: usize,
}

impl<'a, T> Uncut<'a, T> {
    /// From the first row's first token to the last one's last; stretches come in order.
    fn cut(&mut self, bounds: &[usize]) -> &'a mut [T] {
        let (first, last) = (bounds[0], bounds[bounds.len() - 1]);
        let own = self.rest.split_off_mut(..(last - self.reached) * self.across).expect("rows lie within");
        let skipped = (first - self.reached) * self.across;
        self.reached = last;
        &mut own[skipped..]
    }
}

/// What is done to a stretch of rows, `M` keys at a time.
trait Work {
    fn run<S: Simd, const M: usize>(self, simd: S);
}

/// Keys at once where there are 32 registers: 16 sums, 2 inputs, 1 factor. A block of queries is a multiple of it.
const MANY: usize = 8;
/// Keys at once where there are 16.
const FEW: usize = 4;

struct Run<W>(W);

impl<W: Work> WithSimd for Run<W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if has_many_registers::<S>() {
            self.0.run::<S, MANY>(simd);
        } else {
            self.0.run::<S, FEW>(simd);
        }
    }
}

/// Does the work of every stretch, the last one's on this thread.
fn run_all<'a, W: Work + Send>(rows: Rows<'a>, threads: usize, mut of: impl FnMut(Rows<'a>) -> W) {
    let mut works: Vec<W> = rows.stretches(threads.max(1)).into_iter().map(&mut of).collect();
    let Some(last) = works.pop() else { return };
    thread::scope(|scope| {
        for work in works {
            scope.spawn(move || Arch::new().dispatch(Run(work)));
        }
        Arch::new().dispatch(Run(last));
    });
}
