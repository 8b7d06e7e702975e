//! Causal self-attention for training, forward and backward, within rows of any length that lie one behind the other.
//!
//! Each head of each row is made by itself, a block of two registers' worth of queries at a time, so that all of its
//! numbers stay in the processor's first cache. Scores are laid out key after key with the lanes over queries: softmax
//! needs no sums across lanes. The way back makes the scores anew from each query's normaliser. Products of keys behind
//! a query are left out, and rows are not padded. What a row's numbers are depends on that row alone, to the last bit.

use std::{array, thread};

use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Arch, Simd, WithSimd};

use crate::pointwise::exp;
use crate::sheet::{Floats, has_many_registers, zeros};

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

    /// Stretches of whole rows of about as many tokens each.
    fn shares(&self, threads: usize) -> Vec<Self> {
        let rows = self.bounds.len().saturating_sub(1);
        let (Some(&first), Some(&last)) = (self.bounds.first(), self.bounds.last()) else { return Vec::new() };
        let mut shares = Vec::new();
        let mut start = 0;
        for thread in 1..=threads.max(1) {
            let goal = first + (last - first) * thread / threads.max(1);
            let end = start + self.bounds[start + 1..].iter().take_while(|&&bound| bound <= goal).count();
            let end = if thread == threads.max(1) { rows } else { end };
            if end > start {
                shares.push(Self { bounds: &self.bounds[start..=end], ..*self });
            }
            start = end;
        }
        shares
    }
}

/// What every token attends to: of `parts`, (tokens, query and key and value, heads, size), into `mixed`, (tokens, heads,
/// size). `normalisers`, (tokens, heads), are the logarithms of the softmaxes' denominators, for the way back.
pub fn attend<N: Number>(rows: Rows<'_>, parts: &[N], mixed: &mut [N], normalisers: &mut [f32], threads: usize) {
    let (mut mixed, mut normalisers, mut reached) = (mixed, normalisers, 0);
    thread::scope(|scope| {
        let shares = rows.shares(threads);
        let alone = shares.len() == 1;
        for rows in shares {
            let (first, last) = (rows.bounds[0], rows.bounds[rows.bounds.len() - 1]);
            let own = mixed.split_off_mut(..(last - reached) * rows.width()).expect("rows lie within");
            let sums = normalisers.split_off_mut(..(last - reached) * rows.heads).expect("rows lie within");
            let (own, sums) =
                (&mut own[(first - reached) * rows.width()..], &mut sums[(first - reached) * rows.heads..]);
            reached = last;
            let work = Forward { rows, parts, mixed: own, normalisers: sums };
            if alone {
                Arch::new().dispatch(work);
            } else {
                scope.spawn(move || Arch::new().dispatch(work));
            }
        }
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
    let (mut slopes, mut reached) = (slopes, 0);
    thread::scope(|scope| {
        let shares = rows.shares(threads);
        let alone = shares.len() == 1;
        for rows in shares {
            let (first, last) = (rows.bounds[0], rows.bounds[rows.bounds.len() - 1]);
            let own = slopes.split_off_mut(..(last - reached) * 3 * rows.width()).expect("rows lie within");
            let own = &mut own[(first - reached) * 3 * rows.width()..];
            reached = last;
            let work = Backward { rows, parts, grads, normalisers, slopes: own };
            if alone {
                Arch::new().dispatch(work);
            } else {
                scope.spawn(move || Arch::new().dispatch(work));
            }
        }
    });
}

struct Forward<'a, N> {
    rows: Rows<'a>,
    parts: &'a [N],
    /// From the first row's first token on, as `normalisers`.
    mixed: &'a mut [N],
    normalisers: &'a mut [f32],
}

struct Backward<'a, N> {
    rows: Rows<'a>,
    parts: &'a [N],
    grads: &'a [N],
    normalisers: &'a [f32],
    /// From the first row's first token on.
    slopes: &'a mut [N],
}

/// Keys at once where there are 32 registers: 16 sums, 2 inputs, 1 factor. A block of queries is a multiple of it.
const MANY: usize = 8;
/// Keys at once where there are 16.
const FEW: usize = 4;

impl<N: Number> WithSimd for Forward<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if has_many_registers::<S>() {
            self.run::<S, MANY>(simd);
        } else {
            self.run::<S, FEW>(simd);
        }
    }
}

impl<N: Number> WithSimd for Backward<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if has_many_registers::<S>() {
            self.run::<S, MANY>(simd);
        } else {
            self.run::<S, FEW>(simd);
        }
    }
}

/// One head of one row: where its numbers are among all tokens', and how they are laid out here.
#[derive(Clone, Copy)]
struct Place {
    /// The row's first token.
    first: usize,
    /// Its tokens.
    tokens: usize,
    /// The head.
    head: usize,
    /// Numbers in a head.
    size: usize,
    /// The same, padded to whole blocks.
    padded: usize,
    /// Queries in a block: two registers' worth.
    block: usize,
}

impl Place {
    /// Copies a matrix's numbers, (tokens, padded), times `scale`; `across` numbers are from token to token.
    #[inline(always)]
    fn read<N: Number>(self, from: &[N], across: usize, column: usize, scale: f32, into: &mut Floats) {
        let count = self.tokens.next_multiple_of(self.block) * self.padded;
        if into.len() < count {
            into.resize(count, 0.0);
        }
        let rows = from[self.first * across..].chunks(across).take(self.tokens);
        for (row, spots) in rows.zip(into.chunks_exact_mut(self.padded)) {
            for (spot, number) in spots.iter_mut().zip(&row[column..column + self.size]) {
                *spot = number.widen() * scale;
            }
            spots[self.size..].fill(0.0);
        }
    }

    /// The block of `matrix` from token `first` on, turned around: (size, block), zeros for tokens that are none.
    #[inline(always)]
    fn turn(self, matrix: &[f32], first: usize, turned: &mut Floats) {
        if turned.len() < self.size * self.block {
            turned.resize(self.size * self.block, 0.0);
        }
        let real = (self.tokens - first).min(self.block);
        let matrix = &matrix[first * self.padded..];
        for (column, spots) in turned.chunks_exact_mut(self.block).take(self.size).enumerate() {
            for (token, spot) in spots[..real].iter_mut().enumerate() {
                *spot = matrix[token * self.padded + column];
            }
            spots[real..].fill(0.0);
        }
    }
}

impl<N: Number> Forward<'_, N> {
    #[inline(always)]
    fn run<S: Simd, const M: usize>(self, simd: S) {
        let Self { rows, parts, mixed, normalisers } = self;
        let (width, block) = (rows.width(), 2 * S::F32_LANES);
        let (mut query, mut key, mut value) = (zeros(0), zeros(0), zeros(0));
        let (mut turned, mut scores, mut totals) = (zeros(0), zeros(0), zeros(2 * block));
        for bounds in rows.bounds.windows(2) {
            for head in 0..rows.heads {
                let padded = rows.size.next_multiple_of(block);
                let place =
                    Place { first: bounds[0], tokens: bounds[1] - bounds[0], head, size: rows.size, padded, block };
                let column = head * rows.size;
                place.read(parts, 3 * width, column, rows.scale, &mut query);
                place.read(parts, 3 * width, width + column, 1.0, &mut key);
                place.read(parts, 3 * width, 2 * width + column, 1.0, &mut value);
                grow(&mut scores, place.tokens.next_multiple_of(block) * block);
                for first in (0..place.tokens).step_by(block) {
                    place.turn(&query, first, &mut turned);
                    let keys = (first + block).min(place.tokens);
                    softmax::<S, M>(simd, place, first, &key, &turned, &mut scores, &mut totals);
                    for ahead in (0..keys - first).step_by(M) {
                        let reach = (first + ahead + M).min(keys);
                        for start in (0..padded).step_by(block) {
                            let sums =
                                by_columns::<S, M>(simd, &scores[ahead..], block, &value[start..], padded, reach);
                            for (i, sum) in sums.into_iter().enumerate().take(keys - first - ahead) {
                                let token = first + ahead + i;
                                let share = simd.splat_f32s(1.0 / totals[ahead + i]);
                                let row = bounds[0] - rows.bounds[0] + token;
                                let spots = &mut mixed[row * width + column + start..row * width + column + rows.size];
                                let sum = [simd.mul_f32s(sum[0], share), simd.mul_f32s(sum[1], share)];
                                write::<S, N>(sum, spots);
                            }
                        }
                    }
                    for (i, token) in (first..keys).enumerate() {
                        let row = bounds[0] - rows.bounds[0] + token;
                        normalisers[row * rows.heads + place.head] = totals[block + i] + totals[i].ln();
                    }
                }
            }
        }
    }
}

/// (keys, block) exponentials of the scores of a block of queries less each query's highest, zero for keys behind it;
/// `totals` are their sums, and then the highest scores.
#[inline(always)]
fn softmax<S: Simd, const M: usize>(
    simd: S,
    place: Place,
    first: usize,
    key: &[f32],
    turned: &[f32],
    scores: &mut [f32],
    totals: &mut [f32],
) {
    let block = place.block;
    let keys = (first + block).min(place.tokens);
    let queries = numbered::<S>(simd, first);
    let none = simd.splat_f32s(f32::NEG_INFINITY);
    let mut most = [none; 2];
    for start in (0..keys).step_by(M) {
        let sums = by_rows::<S, M>(simd, &key[start * place.padded..], place.padded, turned, block, place.size);
        for ((index, sum), spots) in (start..).zip(sums).zip(scores[start * block..].chunks_exact_mut(block)) {
            let spots = S::as_mut_simd_f32s(spots).0;
            let number = simd.splat_f32s(index as f32);
            for half in 0..2 {
                let seen = simd.less_than_or_equal_f32s(number, queries[half]);
                spots[half] = simd.select_f32s(seen, sum[half], none);
                most[half] = simd.max_f32s(most[half], spots[half]);
            }
        }
    }
    let nothing = simd.splat_f32s(0.0);
    let mut total = [nothing; 2];
    for (index, spots) in scores.chunks_exact_mut(block).take(keys).enumerate() {
        let spots = S::as_mut_simd_f32s(spots).0;
        let number = simd.splat_f32s(index as f32);
        for half in 0..2 {
            let seen = simd.less_than_or_equal_f32s(number, queries[half]);
            let power = exp(simd, simd.sub_f32s(spots[half], most[half]));
            spots[half] = simd.select_f32s(seen, power, nothing);
            total[half] = simd.add_f32s(total[half], spots[half]);
        }
    }
    let spots = S::as_mut_simd_f32s(totals).0;
    spots[..4].copy_from_slice(&[total[0], total[1], most[0], most[1]]);
}

impl<N: Number> Backward<'_, N> {
    #[inline(always)]
    fn run<S: Simd, const M: usize>(self, simd: S) {
        let Self { rows, parts, grads, normalisers, slopes } = self;
        let (width, block) = (rows.width(), 2 * S::F32_LANES);
        let mut desk = Desk::new(block);
        for bounds in rows.bounds.windows(2) {
            for head in 0..rows.heads {
                let padded = rows.size.next_multiple_of(block);
                let place =
                    Place { first: bounds[0], tokens: bounds[1] - bounds[0], head, size: rows.size, padded, block };
                let column = head * rows.size;
                place.read(parts, 3 * width, column, rows.scale, &mut desk.query);
                place.read(parts, 3 * width, width + column, 1.0, &mut desk.key);
                place.read(parts, 3 * width, 2 * width + column, 1.0, &mut desk.value);
                place.read(grads, width, column, 1.0, &mut desk.grad);
                let tokens = place.tokens.next_multiple_of(block);
                grow(&mut desk.shares, tokens * block);
                grow(&mut desk.slopes, tokens * block);
                for sums in [&mut desk.key_slopes, &mut desk.value_slopes] {
                    grow(sums, tokens * padded);
                    sums[..tokens * padded].fill(0.0);
                }
                let start = (bounds[0] - rows.bounds[0]) * 3 * width;
                let own = &mut slopes[start..start + place.tokens * 3 * width];
                for first in (0..place.tokens).step_by(block) {
                    for (index, spot) in desk.normalisers.iter_mut().enumerate() {
                        let token = first + index;
                        let real = token < place.tokens;
                        *spot = if real { normalisers[(place.first + token) * rows.heads + head] } else { 0.0 };
                    }
                    desk.block::<S, M>(simd, place, first);
                    let keys = (first + block).min(place.tokens);
                    for ahead in (0..keys - first).step_by(M) {
                        let reach = (first + ahead + M).min(keys);
                        for start in (0..padded).step_by(block) {
                            let key = &desk.key[start..];
                            let sums = by_columns::<S, M>(simd, &desk.slopes[ahead..], block, key, padded, reach);
                            for (i, sum) in sums.into_iter().enumerate().take(keys - first - ahead) {
                                let scale = simd.splat_f32s(rows.scale);
                                let sum = [simd.mul_f32s(sum[0], scale), simd.mul_f32s(sum[1], scale)];
                                let row = (first + ahead + i) * 3 * width;
                                write::<S, N>(sum, &mut own[row + column + start..row + column + rows.size]);
                            }
                        }
                    }
                }
                for (row, (key, value)) in own
                    .chunks_exact_mut(3 * width)
                    .zip(desk.key_slopes.chunks_exact(padded).zip(desk.value_slopes.chunks_exact(padded)))
                {
                    for (spot, &number) in row[width + column..][..rows.size].iter_mut().zip(key) {
                        *spot = N::narrow(number);
                    }
                    for (spot, &number) in row[2 * width + column..][..rows.size].iter_mut().zip(value) {
                        *spot = N::narrow(number);
                    }
                }
            }
        }
    }
}

/// What one head's way back is worked out on.
struct Desk {
    query: Floats,
    key: Floats,
    value: Floats,
    grad: Floats,
    key_slopes: Floats,
    value_slopes: Floats,
    normalisers: Floats,
    turned_query: Floats,
    turned_grad: Floats,
    /// (keys, block) of softmax.
    shares: Floats,
    /// (keys, block) gradients of the shares, and then of the scores.
    slopes: Floats,
}

impl Desk {
    fn new(block: usize) -> Self {
        let [query, key, value, grad, key_slopes, value_slopes, turned_query, turned_grad, shares, slopes] =
            array::from_fn(|_| zeros(0));
        let normalisers = zeros(block);
        Self {
            query,
            key,
            value,
            grad,
            key_slopes,
            value_slopes,
            normalisers,
            turned_query,
            turned_grad,
            shares,
            slopes,
        }
    }

    /// Softmax and its gradient for the block of queries from `first` on; what it gives keys and values is added.
    #[inline(always)]
    fn block<S: Simd, const M: usize>(&mut self, simd: S, place: Place, first: usize) {
        let (block, padded) = (place.block, place.padded);
        let keys = (first + block).min(place.tokens);
        place.turn(&self.query, first, &mut self.turned_query);
        place.turn(&self.grad, first, &mut self.turned_grad);
        let queries = numbered::<S>(simd, first);
        let nothing = simd.splat_f32s(0.0);
        let mut mean = [nothing; 2];
        for start in (0..keys).step_by(M) {
            let from = start * padded;
            let scores = by_rows::<S, M>(simd, &self.key[from..], padded, &self.turned_query, block, place.size);
            let grads = by_rows::<S, M>(simd, &self.value[from..], padded, &self.turned_grad, block, place.size);
            let normalisers = S::as_simd_f32s(&self.normalisers).0;
            let shares = self.shares[start * block..].chunks_exact_mut(block);
            let slopes = self.slopes[start * block..].chunks_exact_mut(block);
            for ((index, (score, grad)), (shares, slopes)) in
                (start..).zip(scores.into_iter().zip(grads)).zip(shares.zip(slopes))
            {
                let (shares, slopes) = (S::as_mut_simd_f32s(shares).0, S::as_mut_simd_f32s(slopes).0);
                let number = simd.splat_f32s(index as f32);
                for half in 0..2 {
                    let seen = simd.less_than_or_equal_f32s(number, queries[half]);
                    let share = exp(simd, simd.sub_f32s(score[half], normalisers[half]));
                    shares[half] = simd.select_f32s(seen, share, nothing);
                    slopes[half] = grad[half];
                    mean[half] = simd.mul_add_e_f32s(shares[half], grad[half], mean[half]);
                }
            }
        }
        let whole = keys.next_multiple_of(M) * block;
        let shares = S::as_simd_f32s(&self.shares[..whole]).0;
        for (slopes, shares) in
            S::as_mut_simd_f32s(&mut self.slopes[..whole]).0.chunks_exact_mut(2).zip(shares.chunks_exact(2))
        {
            for half in 0..2 {
                slopes[half] = simd.mul_f32s(shares[half], simd.sub_f32s(slopes[half], mean[half]));
            }
        }
        for start in (0..keys).step_by(M) {
            // Queries before the first of these keys do not see them.
            let skipped = start.saturating_sub(first);
            let (from, count) = (start * block + skipped, keys - first - skipped);
            for column in (0..padded).step_by(block) {
                let grad = &self.grad[(first + skipped) * padded + column..];
                let sums = by_rows::<S, M>(simd, &self.shares[from..], block, grad, padded, count);
                add::<S, M>(simd, sums, &mut self.value_slopes[start * padded + column..], padded);
                let query = &self.query[(first + skipped) * padded + column..];
                let sums = by_rows::<S, M>(simd, &self.slopes[from..], block, query, padded, count);
                add::<S, M>(simd, sums, &mut self.key_slopes[start * padded + column..], padded);
            }
        }
    }
}

fn grow(floats: &mut Floats, count: usize) {
    if floats.len() < count {
        floats.resize(count, 0.0);
    }
}

/// The numbers of a block of queries.
#[inline(always)]
fn numbered<S: Simd>(simd: S, first: usize) -> [S::f32s; 2] {
    let mut numbers = [simd.splat_f32s(0.0); 2];
    let spots: &mut [f32] = cast_slice_mut(&mut numbers);
    for (spot, number) in spots.iter_mut().zip(first..) {
        *spot = number as f32;
    }
    numbers
}

/// `M` rows of `left` times the first two registers' worth of columns of `right`, whose rows are `wide`: sums over `count`.
#[inline(always)]
fn by_rows<S: Simd, const M: usize>(
    simd: S,
    left: &[f32],
    across: usize,
    right: &[f32],
    wide: usize,
    count: usize,
) -> [[S::f32s; 2]; M] {
    let left: [&[f32]; M] = array::from_fn(|i| &left[i * across..][..count]);
    let mut sums = [[simd.splat_f32s(0.0); 2]; M];
    for (j, right) in right.chunks(wide).take(count).enumerate() {
        let right = S::as_simd_f32s(&right[..2 * S::F32_LANES]).0;
        for (sum, left) in sums.iter_mut().zip(left) {
            let factor = simd.splat_f32s(left[j]);
            sum[0] = simd.mul_add_e_f32s(factor, right[0], sum[0]);
            sum[1] = simd.mul_add_e_f32s(factor, right[1], sum[1]);
        }
    }
    sums
}

/// The same for `M` columns of `left`.
#[inline(always)]
fn by_columns<S: Simd, const M: usize>(
    simd: S,
    left: &[f32],
    across: usize,
    right: &[f32],
    wide: usize,
    count: usize,
) -> [[S::f32s; 2]; M] {
    let mut sums = [[simd.splat_f32s(0.0); 2]; M];
    for (left, right) in left.chunks(across).zip(right.chunks(wide)).take(count) {
        let right = S::as_simd_f32s(&right[..2 * S::F32_LANES]).0;
        for (sum, &factor) in sums.iter_mut().zip(&left[..M]) {
            let factor = simd.splat_f32s(factor);
            sum[0] = simd.mul_add_e_f32s(factor, right[0], sum[0]);
            sum[1] = simd.mul_add_e_f32s(factor, right[1], sum[1]);
        }
    }
    sums
}

/// Adds `M` sums to as many rows.
#[inline(always)]
fn add<S: Simd, const M: usize>(simd: S, sums: [[S::f32s; 2]; M], into: &mut [f32], across: usize) {
    for (sum, row) in sums.into_iter().zip(into.chunks_mut(across)) {
        let spots = S::as_mut_simd_f32s(&mut row[..2 * S::F32_LANES]).0;
        spots[0] = simd.add_f32s(spots[0], sum[0]);
        spots[1] = simd.add_f32s(spots[1], sum[1]);
    }
}

/// Keeps the first numbers of two registers, as many as there is room for.
#[inline(always)]
fn write<S: Simd, N: Number>(pair: [S::f32s; 2], spots: &mut [N]) {
    let numbers: &[f32] = cast_slice(&pair);
    for (spot, &number) in spots.iter_mut().zip(numbers) {
        *spot = N::narrow(number);
    }
}
