//! What every token attends to.

use pulp::Simd;

use super::head::Head;
use super::products::{Target, by_rows, grow, numbered, weigh};
use super::{Number, Rows, Work};
use crate::pointwise::exp;
use crate::sheet::{Floats, zeros};

/// The rows, and what is written for them.
pub struct Forward<'a, N> {
    pub rows: Rows<'a>,
    pub parts: &'a [N],
    /// From the first row's first token on, as `normalisers`.
    pub mixed: &'a mut [N],
    pub normalisers: &'a mut [f32],
}

impl<N: Number> Work for Forward<'_, N> {
    #[inline(always)]
    fn run<S: Simd, const M: usize>(self, simd: S) {
        let Self { rows, parts, mixed, normalisers } = self;
        let (width, block) = (rows.width(), 2 * S::F32_LANES);
        let (mut query, mut key, mut value) = (zeros(0), zeros(0), zeros(0));
        let mut scores = Scores::new(block);
        let mut factors = zeros(block);
        for head in rows.each_head(block) {
            let column = head.column();
            head.read_own(parts, 3 * width, column, rows.scale, &mut query);
            head.read(parts, 3 * width, width + column, &mut key);
            head.read(parts, 3 * width, 2 * width + column, &mut value);
            let start = head.first - rows.bounds[0];
            let mut target = Target { numbers: &mut mixed[start * width..], across: width, column };
            for first in (head.borrowed..head.tokens).step_by(block) {
                scores.softmax::<S, M>(simd, head, first, &query, &key);
                for (factor, total) in factors.iter_mut().zip(scores.totals.iter()) {
                    *factor = 1.0 / total;
                }
                weigh::<S, N, M>(simd, head, first, &scores.powers, &value, &factors, &mut target);
                for (i, token) in (first..head.keys(first)).enumerate() {
                    let place = (start + token - head.borrowed) * rows.heads + head.number;
                    normalisers[place] = scores.most[i] + scores.totals[i].ln();
                }
            }
        }
    }
}

/// A block of queries' scores.
struct Scores {
    /// (keys, block) their exponentials, less each query's highest; zero for keys behind it.
    powers: Floats,
    /// (block) their sums.
    totals: Floats,
    /// (block) the highest scores.
    most: Floats,
    /// (size, block) the queries.
    turned: Floats,
}

impl Scores {
    fn new(block: usize) -> Self {
        Self { powers: zeros(0), totals: zeros(block), most: zeros(block), turned: zeros(0) }
    }

    /// Of the queries from `first` on.
    #[inline(always)]
    fn softmax<S: Simd, const M: usize>(&mut self, simd: S, head: Head, first: usize, query: &[f32], key: &[f32]) {
        let (block, keys) = (head.block, head.keys(first));
        grow(&mut self.powers, head.room() * block);
        head.turn(query, first, &mut self.turned);
        let queries = numbered::<S>(simd, first);
        let none = simd.splat_f32s(f32::NEG_INFINITY);
        let mut most = [none; 2];
        for start in (0..keys).step_by(M) {
            let left = &key[start * head.padded..];
            let sums = by_rows::<S, M>(simd, left, head.padded, &self.turned, block, head.size);
            for ((index, sum), spots) in (start..).zip(sums).zip(self.powers[start * block..].chunks_exact_mut(block)) {
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
        for (index, spots) in self.powers.chunks_exact_mut(block).take(keys).enumerate() {
            let spots = S::as_mut_simd_f32s(spots).0;
            let number = simd.splat_f32s(index as f32);
            for half in 0..2 {
                let seen = simd.less_than_or_equal_f32s(number, queries[half]);
                let power = exp(simd, simd.sub_f32s(spots[half], most[half]));
                spots[half] = simd.select_f32s(seen, power, nothing);
                total[half] = simd.add_f32s(total[half], spots[half]);
            }
        }
        S::as_mut_simd_f32s(&mut self.totals).0.copy_from_slice(&total);
        S::as_mut_simd_f32s(&mut self.most).0.copy_from_slice(&most);
    }
}
