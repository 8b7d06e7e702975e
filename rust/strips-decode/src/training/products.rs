//! Small products of matrices in the processor's first cache, a few rows of two registers' worth of columns at once.

use std::array;

use pulp::Simd;
use pulp::bytemuck::{cast_slice, cast_slice_mut};

use super::Number;
use super::head::Head;
use crate::sheet::Floats;

/// Makes room for so many numbers.
pub fn grow(floats: &mut Floats, count: usize) {
    if floats.len() < count {
        floats.resize(count, 0.0);
    }
}

/// The numbers of the queries in the block from `first` on.
#[inline(always)]
pub fn numbered<S: Simd>(simd: S, first: usize) -> [S::f32s; 2] {
    let mut numbers = [simd.splat_f32s(0.0); 2];
    let spots: &mut [f32] = cast_slice_mut(&mut numbers);
    for (spot, number) in spots.iter_mut().zip(first..) {
        *spot = number as f32;
    }
    numbers
}

/// `M` rows of `left` times the first two registers' worth of columns of `right`, whose rows are `wide`: sums over `count`.
#[inline(always)]
pub fn by_rows<S: Simd, const M: usize>(
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
        add_multiples(simd, &mut sums, right, left.iter().map(|left| left[j]));
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
        add_multiples(simd, &mut sums, right, left[..M].iter().copied());
    }
    sums
}

/// Adds to each of `M` sums its factor times the first two registers' worth of a row.
#[inline(always)]
fn add_multiples<S: Simd, const M: usize>(
    simd: S,
    sums: &mut [[S::f32s; 2]; M],
    row: &[f32],
    factors: impl Iterator<Item = f32>,
) {
    let row = S::as_simd_f32s(&row[..2 * S::F32_LANES]).0;
    for (sum, factor) in sums.iter_mut().zip(factors) {
        let factor = simd.splat_f32s(factor);
        sum[0] = simd.mul_add_e_f32s(factor, row[0], sum[0]);
        sum[1] = simd.mul_add_e_f32s(factor, row[1], sum[1]);
    }
}

/// Adds `M` sums to as many rows.
#[inline(always)]
pub fn add<S: Simd, const M: usize>(simd: S, sums: [[S::f32s; 2]; M], into: &mut [f32], across: usize) {
    for (sum, row) in sums.into_iter().zip(into.chunks_mut(across)) {
        let spots = S::as_mut_simd_f32s(&mut row[..2 * S::F32_LANES]).0;
        spots[0] = simd.add_f32s(spots[0], sum[0]);
        spots[1] = simd.add_f32s(spots[1], sum[1]);
    }
}

/// Where a head's numbers of each token go: a row's own table, from the first of its own tokens on.
pub struct Target<'a, N> {
    /// The numbers.
    pub numbers: &'a mut [N],
    /// Numbers from token to token.
    pub across: usize,
    /// The head's first number in a token.
    pub column: usize,
}

/// For each query of the block from `first` on the rows of `matrix`, (keys, padded), weighed by its column of `weights`,
/// (keys, block), times its factor.
#[inline(always)]
pub fn weigh<S: Simd, N: Number, const M: usize>(
    simd: S,
    head: Head,
    first: usize,
    weights: &[f32],
    matrix: &[f32],
    factors: &[f32],
    into: &mut Target<'_, N>,
) {
    let keys = head.keys(first);
    for ahead in (0..keys - first).step_by(M) {
        let reach = (first + ahead + M).min(keys);
        for start in (0..head.padded).step_by(head.block) {
            let right = &matrix[start..];
            let sums = by_columns::<S, M>(simd, &weights[ahead..], head.block, right, head.padded, reach);
            for ((token, sum), &factor) in (first + ahead..keys).zip(sums).zip(&factors[ahead..]) {
                let factor = simd.splat_f32s(factor);
                let pair = [simd.mul_f32s(sum[0], factor), simd.mul_f32s(sum[1], factor)];
                let place = (token - head.borrowed) * into.across + into.column;
                keep(cast_slice(&pair), &mut into.numbers[place + start..place + head.size]);
            }
        }
    }
}

/// Keeps as many numbers as there is room for.
#[inline(always)]
pub fn keep<N: Number>(numbers: &[f32], spots: &mut [N]) {
    for (spot, &number) in spots.iter_mut().zip(numbers) {
        *spot = N::narrow(number);
    }
}
