//! A row's keys and values, and what a token of it attends to.

use pulp::{Arch, Simd, WithSimd};

use crate::pointwise::exp;
use crate::sheet::{Floats, Machine, zeros};

/// How a layer's numbers fall into heads.
#[derive(Clone, Copy, Debug)]
pub struct Heads {
    /// Heads.
    pub count: usize,
    /// Numbers in a head.
    pub size: usize,
    /// Factor of every score.
    pub scale: f32,
}

/// Keys and values of one row in one layer.
///
/// Keys are in blocks of a register's worth of positions: block after block, in a block head after head, in a head
/// number after number, so that scores of neighbouring positions are made side by side. Values are position after
/// position, each head padded to whole registers.
#[derive(Clone, Debug)]
pub struct Cache {
    keys: Floats,
    values: Floats,
}

impl Cache {
    /// Of no positions.
    pub fn new() -> Self {
        Self { keys: zeros(0), values: zeros(0) }
    }

    /// Writes the key and the value of a position; all before it must have been written.
    pub fn put(
        &mut self,
        position: usize,
        key: impl Iterator<Item = f32>,
        value: impl Iterator<Item = f32>,
        heads: Heads,
        machine: Machine,
    ) {
        let (lanes, width) = (machine.lanes, heads.count * heads.size);
        let (block, lane) = (position / lanes * lanes * width, position % lanes);
        if self.keys.len() < block + lanes * width {
            self.keys.resize(block + lanes * width, 0.0);
        }
        for (spot, number) in self.keys[block + lane..].iter_mut().step_by(lanes).zip(key.take(width)) {
            *spot = number;
        }
        let padded = heads.size.next_multiple_of(lanes);
        let start = position * heads.count * padded;
        if self.values.len() < start + heads.count * padded {
            self.values.resize((position + 1).next_multiple_of(lanes) * heads.count * padded, 0.0);
        }
        let mut value = value;
        for head in self.values[start..start + heads.count * padded].chunks_exact_mut(padded) {
            for (spot, number) in head[..heads.size].iter_mut().zip(&mut value) {
                *spot = number;
            }
        }
    }
}

/// One token's attention to the first `positions` of its row: `query` is (heads, size), and so is `mixed` in the end,
/// each head padded to whole registers.
pub struct Attend<'a> {
    /// The row's keys and values.
    pub cache: &'a Cache,
    /// What is asked.
    pub query: &'a [f32],
    /// How many positions are attended to.
    pub positions: usize,
    /// The layer's heads.
    pub heads: Heads,
    /// Room for a number a position, padded to whole registers.
    pub scores: &'a mut Floats,
    /// The values, mixed.
    pub mixed: &'a mut Floats,
}

impl Attend<'_> {
    /// Fills `mixed`.
    pub fn run(self) {
        Arch::new().dispatch(self);
    }
}

impl WithSimd for Attend<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { cache, query, positions, heads, scores, mixed } = self;
        let lanes = S::F32_LANES;
        let padded = heads.size.next_multiple_of(lanes);
        let covered = positions.next_multiple_of(lanes);
        if scores.len() < covered {
            scores.resize(covered, 0.0);
        }
        let stride = heads.count * heads.size * lanes;
        for (head, (query, mixed)) in query.chunks_exact(heads.size).zip(mixed.chunks_exact_mut(padded)).enumerate() {
            let scores = &mut scores[..covered];
            let begin = head * heads.size * lanes;
            for (block, spot) in cache.keys.chunks_exact(stride).zip(S::as_mut_simd_f32s(scores).0) {
                let keys = S::as_simd_f32s(&block[begin..begin + heads.size * lanes]).0;
                let mut sum = [simd.splat_f32s(0.0); 2];
                for (pair, asked) in keys.chunks_exact(2).zip(query.chunks_exact(2)) {
                    sum[0] = simd.mul_add_e_f32s(pair[0], simd.splat_f32s(asked[0]), sum[0]);
                    sum[1] = simd.mul_add_e_f32s(pair[1], simd.splat_f32s(asked[1]), sum[1]);
                }
                for (&key, &asked) in keys.chunks_exact(2).remainder().iter().zip(query.chunks_exact(2).remainder()) {
                    sum[0] = simd.mul_add_e_f32s(key, simd.splat_f32s(asked), sum[0]);
                }
                *spot = simd.mul_f32s(simd.add_f32s(sum[0], sum[1]), simd.splat_f32s(heads.scale));
            }
            scores[positions..].fill(f32::NEG_INFINITY);
            let total = softmax(simd, S::as_mut_simd_f32s(scores).0);
            let share = simd.splat_f32s(1.0 / total);
            let values = &cache.values[head * padded..];
            let across = heads.count * padded;
            let mut rest = S::as_mut_simd_f32s(mixed).0;
            let mut first = 0;
            while !rest.is_empty() {
                let taken = match rest.len() {
                    4.. => mix::<S, 4>(simd, values, first, across, &scores[..positions], share, rest),
                    2 | 3 => mix::<S, 2>(simd, values, first, across, &scores[..positions], share, rest),
                    _ => mix::<S, 1>(simd, values, first, across, &scores[..positions], share, rest),
                };
                first += taken * lanes;
                rest = &mut rest[taken..];
            }
        }
    }
}

/// Exponentials of scores less the highest; their sum.
#[inline(always)]
fn softmax<S: Simd>(simd: S, scores: &mut [S::f32s]) -> f32 {
    let mut most = simd.splat_f32s(f32::NEG_INFINITY);
    for &score in scores.iter() {
        most = simd.max_f32s(most, score);
    }
    let most = simd.splat_f32s(simd.reduce_max_f32s(most));
    let mut total = simd.splat_f32s(0.0);
    for score in scores {
        *score = exp(simd, simd.sub_f32s(*score, most));
        total = simd.add_f32s(total, *score);
    }
    simd.reduce_sum_f32s(total)
}

/// `R` registers of a head's values from `first` on, each position's weighed by its score; gives `R`.
#[inline(always)]
fn mix<S: Simd, const R: usize>(
    simd: S,
    values: &[f32],
    first: usize,
    across: usize,
    scores: &[f32],
    share: S::f32s,
    mixed: &mut [S::f32s],
) -> usize {
    let mut sums = [[simd.splat_f32s(0.0); R]; 2];
    let width = R * S::F32_LANES;
    for (positions, scores) in values.chunks(2 * across).zip(scores.chunks(2)) {
        for ((sum, position), &score) in sums.iter_mut().zip(positions.chunks(across)).zip(scores) {
            let score = simd.splat_f32s(score);
            let value = S::as_simd_f32s(&position[first..first + width]).0;
            for (sum, &value) in sum.iter_mut().zip(value) {
                *sum = simd.mul_add_e_f32s(value, score, *sum);
            }
        }
    }
    let [even, odd] = sums;
    for ((spot, even), odd) in mixed.iter_mut().zip(even).zip(odd) {
        *spot = simd.mul_f32s(simd.add_f32s(even, odd), share);
    }
    R
}
