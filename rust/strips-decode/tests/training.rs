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
        let rows = Rows { bounds: &bounds, borrowed: &[], heads, size, scale: scale / (size as f32).sqrt() };
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
    fn rows_that_borrow_attend_as_if_what_they_borrow_were_theirs(
        families in prop::collection::vec((1_usize..70, prop::collection::vec((0_usize..100, 0_usize..70), 0..4)), 1..4),
        heads in 1_usize..4,
        size in 1_usize..40,
        threads in 1_usize..4,
        seed: u64,
    ) {
        // A row that borrows nothing lends to those behind it, as the family's first does.
        let (mut bounds, mut borrowed, mut whole_bounds, mut origin) = (vec![0], Vec::new(), vec![0], Vec::new());
        for (length, others) in families {
            let mut lender = (bounds[bounds.len() - 1], length);
            for (percent, own) in std::iter::once((0, length)).chain(others) {
                let start = bounds[bounds.len() - 1];
                let lent = lender.1 * percent / 99;
                if lent == 0 {
                    lender = (start, own);
                }
                bounds.push(start + own);
                borrowed.push(lent);
                origin.extend((lender.0..lender.0 + lent).chain(start..start + own));
                whole_bounds.push(origin.len());
            }
        }
        let (tokens, width) = (bounds[bounds.len() - 1], heads * size);
        let (parts, grads) = (draw(seed, tokens * 3 * width, 1.0), draw(!seed, tokens * width, 1.0));
        let rows = Rows { bounds: &bounds, borrowed: &borrowed, heads, size, scale: 1.0 / (size as f32).sqrt() };
        let (mixed, slopes) = both(rows, &parts, &grads, threads);

        // The twin repeats borrowed tokens, nobody reads what those attend to, and all gradients of a token add up.
        let repeat = |numbers: &[f32], across: usize| -> Vec<f32> {
            origin.iter().flat_map(|&token| numbers[token * across..(token + 1) * across].iter().copied()).collect()
        };
        let mut whole_grads = repeat(&grads, width);
        let starts = whole_bounds.windows(2).zip(&borrowed).map(|(row, &lent)| row[0]..row[0] + lent);
        let own: Vec<bool> = starts.fold(vec![true; origin.len()], |mut own, lent| { own[lent].fill(false); own });
        for (token, _) in own.iter().enumerate().filter(|(_, own)| !**own) {
            whole_grads[token * width..(token + 1) * width].fill(0.0);
        }
        let whole = Rows { bounds: &whole_bounds, borrowed: &[], ..rows };
        let (whole_mixed, whole_slopes) = plain(whole, &repeat(&parts, 3 * width), &whole_grads);
        let (mut wanted_mixed, mut wanted_slopes) = (vec![0.0; mixed.len()], vec![0.0; slopes.len()]);
        for (token, &from) in origin.iter().enumerate() {
            for i in (0..width).filter(|_| own[token]) {
                wanted_mixed[from * width + i] = whole_mixed[token * width + i];
            }
            for i in 0..3 * width {
                wanted_slopes[from * 3 * width + i] += whole_slopes[token * 3 * width + i];
            }
        }
        near(&mixed, &wanted_mixed, 1e-5);
        near(&slopes, &wanted_slopes, 1e-4);
    }

    #[test]
    fn half_precision_is_that_of_numbers_rounded_before_and_after(length in 1_usize..60, size in 1_usize..40, seed: u64) {
        let half = |numbers: &[f32]| -> Vec<u16> { numbers.iter().map(|&n| strips_decode::Number::narrow(n)).collect() };
        let whole = |numbers: &[u16]| -> Vec<f32> { numbers.iter().map(|&n| strips_decode::Number::widen(n)).collect() };
        let bounds = [0, length];
        let rows = Rows { bounds: &bounds, borrowed: &[], heads: 2, size, scale: 0.5 };
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
    let rows = Rows { bounds: &[0, length], borrowed: &[], heads: 1, size, scale: 300.0 };
    let (parts, grads) = (draw(3, length * 3 * size, 1.0), draw(4, length * size, 1.0));
    let (mixed, slopes) = both(rows, &parts, &grads, 1);
    let (wanted, _) = plain(rows, &parts, &grads);
    near(&mixed, &wanted, 1e-3);
    assert!(slopes.iter().all(|slope| slope.is_finite()));
}

#[test]
fn no_rows_are_no_trouble() {
    let rows = Rows { bounds: &[0], borrowed: &[], heads: 1, size: 4, scale: 1.0 };
    let (mixed, _) = both(rows, &[1.0; 24], &[1.0; 8], 2);
    assert_eq!(mixed, [0.0; 8]);
}
