//! The gradient of what every token attends to.

use std::array;

use pulp::Simd;

use super::head::Head;
use super::products::{Target, add, by_rows, grow, keep, numbered, weigh};
use super::{Number, Rows, Work};
use crate::pointwise::exp;
use crate::sheet::{Floats, zeros};

/// The rows, what is known of them, and what is written.
pub struct Backward<'a, N> {
    pub rows: Rows<'a>,
    pub parts: &'a [N],
    pub grads: &'a [N],
    pub normalisers: &'a [f32],
    /// From the first row's first token on.
    pub slopes: &'a mut [N],
}

impl<N: Number> Work for Backward<'_, N> {
    #[inline(always)]
    fn run<S: Simd, const M: usize>(self, simd: S) {
        let Self { rows, parts, grads, normalisers, slopes } = self;
        let (width, block) = (rows.width(), 2 * S::F32_LANES);
        let mut desk = Desk::new(block);
        let mut factors = zeros(block);
        factors.fill(rows.scale);
        for head in rows.each_head(block) {
            let column = head.column();
            head.read_own(parts, 3 * width, column, rows.scale, &mut desk.query);
            head.read(parts, 3 * width, width + column, &mut desk.key);
            head.read(parts, 3 * width, 2 * width + column, &mut desk.value);
            head.read_own(grads, width, column, 1.0, &mut desk.grad);
            desk.clear(head);
            let start = (head.first - rows.bounds[0]) * 3 * width;
            let own = &mut slopes[start..start + head.own() * 3 * width];
            for first in (head.borrowed..head.tokens).step_by(block) {
                let token = head.first + first - head.borrowed;
                let known = normalisers[token * rows.heads + head.number..].iter().step_by(rows.heads);
                desk.normalisers.fill(0.0);
                for (spot, &number) in desk.normalisers.iter_mut().zip(known.take(head.keys(first) - first)) {
                    *spot = number;
                }
                desk.block::<S, M>(simd, head, first);
                let mut target = Target { numbers: &mut *own, across: 3 * width, column };
                weigh::<S, N, M>(simd, head, first, &desk.slopes, &desk.key, &factors, &mut target);
            }
            desk.settle(head);
            let sums = desk.key_slopes.chunks_exact(head.padded).zip(desk.value_slopes.chunks_exact(head.padded));
            for (row, (key, value)) in own.chunks_exact_mut(3 * width).zip(sums.skip(head.borrowed)) {
                keep(key, &mut row[width + column..][..head.size]);
                keep(value, &mut row[2 * width + column..][..head.size]);
            }
        }
    }
}

/// What one head's way back is worked out on.
struct Desk {
    /// (tokens, padded) each, queries times the scale.
    query: Floats,
    key: Floats,
    value: Floats,
    grad: Floats,
    key_slopes: Floats,
    value_slopes: Floats,
    /// What a family's rows that borrow have given the keys and values which they borrow, as these two.
    owed_keys: Floats,
    owed_values: Floats,
    /// How many tokens these are about.
    owed: usize,
    /// (block) of the queries at hand.
    normalisers: Floats,
    /// (size, block) the queries at hand.
    turned_query: Floats,
    turned_grad: Floats,
    /// (keys, block) of softmax.
    shares: Floats,
    /// (keys, block) gradients of the shares, and then of the scores.
    slopes: Floats,
}

impl Desk {
    fn new(block: usize) -> Self {
        let [query, key, value, grad, key_slopes, value_slopes, owed_keys, owed_values] = array::from_fn(|_| zeros(0));
        let [turned_query, turned_grad, shares, slopes] = array::from_fn(|_| zeros(0));
        let normalisers = zeros(block);
        Self {
            query,
            key,
            value,
            grad,
            key_slopes,
            value_slopes,
            owed_keys,
            owed_values,
            owed: 0,
            normalisers,
            turned_query,
            turned_grad,
            shares,
            slopes,
        }
    }

    /// Makes room for a head, whose keys and values have got nothing yet.
    fn clear(&mut self, head: Head) {
        for table in [&mut self.shares, &mut self.slopes] {
            grow(table, head.room() * head.block);
        }
        for sums in [&mut self.key_slopes, &mut self.value_slopes] {
            grow(sums, head.room() * head.padded);
            sums[..head.room() * head.padded].fill(0.0);
        }
    }

    /// Puts what a row gives borrowed tokens aside, or adds what was put aside to those of the row that lends them.
    fn settle(&mut self, head: Head) {
        let (borrowed, owed) = (head.borrowed * head.padded, self.owed * head.padded);
        let tables = [(&mut self.key_slopes, &mut self.owed_keys), (&mut self.value_slopes, &mut self.owed_values)];
        for (sums, owing) in tables {
            if borrowed == 0 {
                sums[..owed].iter_mut().zip(&owing[..owed]).for_each(|(sum, part)| *sum += part);
                continue;
            }
            grow(owing, borrowed);
            owing[owed.min(borrowed)..borrowed].fill(0.0);
            owing[..borrowed].iter_mut().zip(&sums[..borrowed]).for_each(|(part, sum)| *part += sum);
        }
        self.owed = if borrowed == 0 { 0 } else { self.owed.max(head.borrowed) };
    }

    /// Softmax and its gradient for the block of queries from `first` on; what it gives keys and values is added.
    #[inline(always)]
    fn block<S: Simd, const M: usize>(&mut self, simd: S, head: Head, first: usize) {
        self.softmax::<S, M>(simd, head, first);
        let (block, padded, keys) = (head.block, head.padded, head.keys(first));
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

    /// The shares of the block of queries from `first` on, and the gradients of their scores.
    #[inline(always)]
    fn softmax<S: Simd, const M: usize>(&mut self, simd: S, head: Head, first: usize) {
        let (block, padded, keys) = (head.block, head.padded, head.keys(first));
        head.turn(&self.query, first, &mut self.turned_query);
        head.turn(&self.grad, first, &mut self.turned_grad);
        let queries = numbered::<S>(simd, first);
        let nothing = simd.splat_f32s(0.0);
        let mut mean = [nothing; 2];
        for start in (0..keys).step_by(M) {
            let from = start * padded;
            let scores = by_rows::<S, M>(simd, &self.key[from..], padded, &self.turned_query, block, head.size);
            let grads = by_rows::<S, M>(simd, &self.value[from..], padded, &self.turned_grad, block, head.size);
            let normalisers = S::as_simd_f32s(&self.normalisers).0;
            let shares = self.shares[start * block..].chunks_exact_mut(block);
            let slopes = self.slopes[start * block..].chunks_exact_mut(block);
            let made = scores.into_iter().zip(grads);
            for ((index, (score, grad)), (shares, slopes)) in (start..).zip(made).zip(shares.zip(slopes)) {
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
        let shares = S::as_simd_f32s(&self.shares[..whole]).0.chunks_exact(2);
        let slopes = S::as_mut_simd_f32s(&mut self.slopes[..whole]).0.chunks_exact_mut(2);
        for (slopes, shares) in slopes.zip(shares) {
            for half in 0..2 {
                slopes[half] = simd.mul_f32s(shares[half], simd.sub_f32s(slopes[half], mean[half]));
            }
        }
    }
}
