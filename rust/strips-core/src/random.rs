//! A counter-based pseudo-random generator whose every draw is fixed by (seed, stream).
//!
//! Data sets promise the same bytes for the same seed, on any machine and in any later version, so the generator is
//! spelled out here rather than taken from a library that may change how it maps bits to numbers. Not for secrets.
//! Source: `SplitMix64` (Steele, Lea, Flood, 2014) for the stream; Lemire (2019) for unbiased bounded draws.

use num_bigint::BigUint;

/// A reproducible stream of random numbers.
///
/// ```
/// use strips_core::random::Random;
/// let (mut a, mut b) = (Random::new(7, 3), Random::new(7, 3));
/// assert_eq!(a.below(100), b.below(100));
/// ```
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The stream number `stream` of the seed `seed`. Different pairs give unrelated streams.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { state: mix(mix(seed ^ 0x6A09_E667_F3BC_C909).wrapping_add(stream)) }
    }

    /// A stream of its own for one named purpose, so that adding a draw for one purpose does not shift another's.
    #[must_use]
    pub fn fork(&self, purpose: &str) -> Self {
        let folded = purpose.bytes().fold(self.state, |hash, byte| mix(hash ^ u64::from(byte)));
        Self { state: folded }
    }

    /// The next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.state)
    }

    /// A number below `bound`, each equally likely.
    ///
    /// # Panics
    /// When `bound` is zero.
    pub fn below(&mut self, bound: usize) -> usize {
        assert!(bound > 0, "a draw needs at least one outcome");
        let bound = bound as u64;
        let threshold = bound.wrapping_neg() % bound;
        loop {
            let product = u128::from(self.bits()) * u128::from(bound);
            if product as u64 >= threshold {
                return (product >> 64) as usize;
            }
        }
    }

    /// A big number below `bound`, each equally likely; by rejection, in fewer than two tries on average.
    ///
    /// # Panics
    /// When `bound` is zero.
    pub fn below_big(&mut self, bound: &BigUint) -> BigUint {
        let bits = bound.bits();
        assert!(bits > 0, "a draw needs at least one outcome");
        let words = bits.div_ceil(32) as usize;
        let mask = u32::MAX >> ((32 - bits % 32) % 32);
        loop {
            let mut digits: Vec<u32> = (0..words).map(|_| (self.bits() >> 32) as u32).collect();
            digits[words - 1] &= mask;
            let drawn = BigUint::new(digits);
            if drawn < *bound {
                return drawn;
            }
        }
    }

    /// A number in `[0, 1)` with 53 random bits.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// One of `items`, each equally likely.
    ///
    /// # Panics
    /// When `items` is empty.
    pub fn choice<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.below(items.len())]
    }

    /// Puts `items` into a uniformly random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }

    /// The position drawn from unnormalised, non-negative `weights`.
    ///
    /// # Panics
    /// When no weight is positive.
    pub fn weighted(&mut self, weights: &[f64]) -> usize {
        let total: f64 = weights.iter().sum();
        assert!(total > 0.0, "a weighted draw needs a positive weight");
        let mut left = self.unit() * total;
        for (index, &weight) in weights.iter().enumerate() {
            left -= weight;
            if left < 0.0 {
                return index;
            }
        }
        weights.iter().rposition(|&weight| weight > 0.0).expect("some weight is positive")
    }
}

/// The finaliser of `SplitMix64`: a bijection of 64-bit words whose outputs look independent.
fn mix(word: u64) -> u64 {
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    word ^ (word >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stream_is_fixed_for_ever() {
        let mut random = Random::new(0, 0);
        let first: Vec<u64> = (0..3).map(|_| random.bits()).collect();
        let again: Vec<u64> = {
            let mut random = Random::new(0, 0);
            (0..3).map(|_| random.bits()).collect()
        };
        assert_eq!(first, again);
        assert_ne!(Random::new(0, 1).bits(), Random::new(1, 0).bits());
    }

    #[test]
    fn bounded_draws_reach_every_outcome_about_equally() {
        let mut random = Random::new(1, 2);
        let mut counts = [0usize; 7];
        (0..70_000).for_each(|_| counts[random.below(7)] += 1);
        assert!(counts.iter().all(|&n| (9_500..10_500).contains(&n)), "{counts:?}");
        let bound = BigUint::from(5u32);
        let mut counts = [0usize; 5];
        for _ in 0..50_000 {
            counts[random.below_big(&bound).iter_u32_digits().next().unwrap_or(0) as usize] += 1;
        }
        assert!(counts.iter().all(|&n| (9_500..10_500).contains(&n)), "{counts:?}");
    }

    #[test]
    fn a_shuffle_keeps_every_item() {
        let mut items: Vec<usize> = (0..50).collect();
        Random::new(3, 4).shuffle(&mut items);
        assert_ne!(items, (0..50).collect::<Vec<_>>());
        items.sort_unstable();
        assert_eq!(items, (0..50).collect::<Vec<_>>());
    }
}
