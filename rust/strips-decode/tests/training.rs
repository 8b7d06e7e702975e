//! Attention for training against a plain one in double precision, and the laws of rows.

use proptest::prelude::*;
use strips_decode::{Rows, attend, attend_back};

/// Numbers between -1 and 1 that a seed decides.
fn draw(seed: u64, count: usize, scale: f32) -> Vec<f32> {
    let mut state = seed;
    (0..count)
        .map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) as f32 / (1 << 23) as f32 - 1.0) * scale
        })
        .collect()
}

/// What anyone would write: mixed values, and the gradient of their sum weighed by `grads`, for one row.
fn plain(rows: Rows<'_>, parts: &[f32], grads: &[f32]) -> (Vec<f64>, Vec<f64>) {
    let (heads, size) = (rows.heads, rows.size);
    let width = heads * size;
    let mut mixed = vec![0.0; grads.len()];
    let mut slopes = vec![0.0; parts.len()];
    for bounds in rows.bounds.windows(2) {
        for head in 0..heads {
            let at = |part: usize, token: usize, i: usize| token * 3 * width + part * width + head * size + i;
            let get = |part: usize, token: usize, i: usize| f64::from(parts[at(part, token, i)]);
            for query in bounds[0]..bounds[1] {
                let score = |key: usize| {
                    f64::from(rows.scale) * (0..size).map(|i| get(0, query, i) * get(1, key, i)).sum::<f64>()
                };
                let scores: Vec<f64> = (bounds[0]..=query).map(score).collect();
                let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let total: f64 = scores.iter().map(|score| (score - most).exp()).sum();
                let shares: Vec<f64> = scores.iter().map(|score| (score - most).exp() / total).collect();
                let spot = |i: usize| query * width + head * size + i;
                let grad = |i: usize| f64::from(grads[spot(i)]);
                let pulls: Vec<f64> =
                    (bounds[0]..=query).map(|key| (0..size).map(|i| grad(i) * get(2, key, i)).sum()).collect();
                let mean: f64 = shares.iter().zip(&pulls).map(|(share, pull)| share * pull).sum();
                for (key, (share, pull)) in (bounds[0]..=query).zip(shares.iter().zip(&pulls)) {
                    let slope = share * (pull - mean) * f64::from(rows.scale);
                    for i in 0..size {
                        mixed[spot(i)] += share * get(2, key, i);
                        slopes[at(2, key, i)] += share * grad(i);
                        slopes[at(0, query, i)] += slope * get(1, key, i);
                        slopes[at(1, key, i)] += slope * get(0, query, i);
                    }
                }
            }
        }
    }
    (mixed, slopes)
}

fn near(found: &[f32], wanted: &[f64], tolerance: f64) {
    for (index, (&found, &wanted)) in found.iter().zip(wanted).enumerate() {
        assert!((f64::from(found) - wanted).abs() <= tolerance, "{index}: {found} for {wanted}");
    }
}

fn both(rows: Rows<'_>, parts: &[f32], grads: &[f32], threads: usize) -> (Vec<f32>, Vec<f32>) {
    let (mut mixed, mut slopes) = (vec![0.0; grads.len()], vec![0.0; parts.len()]);
    let mut normalisers = vec![0.0; grads.len() / rows.size];
    attend(rows, parts, &mut mixed, &mut normalisers, threads);
    attend_back(rows, parts, grads, &normalisers, &mut slopes, threads);
    (mixed, slopes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn attention_is_the_plain_one(
        lengths in prop::collection::vec(1_usize..90, 1..5),
        heads in 1_usize..4,
        size in 1_usize..70,
        before in 0_usize..3,
        scale in 0.1_f32..3.0,
        threads in 1_usize..4,
        seed: u64,
    ) {
        let bounds: Vec<usize> = std::iter::once(before)
            .chain(lengths.iter().scan(before, |end, length| { *end += length; Some(*end) }))
            .collect();
        // Two tokens behind the last row are of none.
        let (tokens, width) = (bounds[bounds.len() - 1] + 2, heads * size);
        let (parts, grads) = (draw(seed, tokens * 3 * width, 1.0), draw(!seed, tokens * width, 1.0));
        let rows = Rows { bounds: &bounds, heads, size, scale: scale / (size as f32).sqrt() };
        let (mixed, slopes) = both(rows, &parts, &grads, threads);
        let (wanted_mixed, wanted_slopes) = plain(rows, &parts, &grads);
        near(&mixed, &wanted_mixed, 1e-5);
        near(&slopes, &wanted_slopes, 1e-4);
        // Alone a row's numbers are the same, to the last bit.
        let last = [bounds[bounds.len() - 2], bounds[bounds.len() - 1]];
        let (alone, slopes_alone) = both(Rows { bounds: &last, ..rows }, &parts, &grads, 1);
        prop_assert_eq!(&alone[last[0] * width..last[1] * width], &mixed[last[0] * width..last[1] * width]);
        prop_assert_eq!(&slopes_alone[last[0] * 3 * width..], &slopes[last[0] * 3 * width..]);
    }

    #[test]
    fn half_precision_is_that_of_numbers_rounded_before_and_after(length in 1_usize..60, size in 1_usize..40, seed: u64) {
        let half = |numbers: &[f32]| -> Vec<u16> { numbers.iter().map(|&n| strips_decode::Number::narrow(n)).collect() };
        let whole = |numbers: &[u16]| -> Vec<f32> { numbers.iter().map(|&n| strips_decode::Number::widen(n)).collect() };
        let bounds = [0, length];
        let rows = Rows { bounds: &bounds, heads: 2, size, scale: 0.5 };
        let (parts, grads) = (half(&draw(seed, length * 6 * size, 1.0)), half(&draw(!seed, length * 2 * size, 1.0)));
        let (mut mixed, mut slopes) = (vec![0; grads.len()], vec![0; parts.len()]);
        let mut normalisers = vec![0.0; length * 2];
        attend(rows, &parts, &mut mixed, &mut normalisers, 1);
        attend_back(rows, &parts, &grads, &normalisers, &mut slopes, 1);
        let (exact, exact_slopes) = both(rows, &whole(&parts), &whole(&grads), 1);
        prop_assert_eq!(mixed, half(&exact));
        prop_assert_eq!(slopes, half(&exact_slopes));
    }
}

#[test]
fn scores_far_apart_are_no_trouble() {
    let (length, size) = (40, 8);
    let rows = Rows { bounds: &[0, length], heads: 1, size, scale: 300.0 };
    let (parts, grads) = (draw(3, length * 3 * size, 1.0), draw(4, length * size, 1.0));
    let (mixed, slopes) = both(rows, &parts, &grads, 1);
    let (wanted, _) = plain(rows, &parts, &grads);
    near(&mixed, &wanted, 1e-3);
    assert!(slopes.iter().all(|slope| slope.is_finite()));
}

#[test]
fn no_rows_are_no_trouble() {
    let rows = Rows { bounds: &[0], heads: 1, size: 4, scale: 1.0 };
    let (mixed, _) = both(rows, &[1.0; 24], &[1.0; 8], 2);
    assert_eq!(mixed, [0.0; 8]);
}
