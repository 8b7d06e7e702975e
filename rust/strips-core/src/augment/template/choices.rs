//! Making choices: drawn at random, or every combination in turn.

use crate::random::Random;

/// Something that picks one of `count` options whenever it is asked.
pub(super) trait Choices {
    /// A number below `count`, which is positive.
    fn choose(&mut self, count: usize) -> usize;

    /// Whether a multiset is to be listed once, its members ascending, rather than drawn member by member.
    fn lists_multisets(&self) -> bool;
}

impl Choices for Random {
    fn choose(&mut self, count: usize) -> usize {
        self.below(count)
    }

    fn lists_multisets(&self) -> bool {
        false
    }
}

/// Every combination of choices in turn, in lexicographic order, without knowing beforehand which will be asked.
///
/// The work is done again for each combination, with the same choices up to the last one that has an option left: a
/// counter whose digits' bases are learnt on the way.
#[derive(Default)]
pub(super) struct Odometer {
    /// Option taken and number of options, for each choice so far.
    digits: Vec<(usize, usize)>,
    asked: usize,
}

impl Odometer {
    /// Moves on to the next combination; false when there is none.
    pub(super) fn advance(&mut self) -> bool {
        self.digits.truncate(self.asked);
        self.asked = 0;
        while let Some((taken, count)) = self.digits.pop() {
            if taken + 1 < count {
                self.digits.push((taken + 1, count));
                return true;
            }
        }
        false
    }
}

impl Choices for Odometer {
    fn choose(&mut self, count: usize) -> usize {
        if self.asked == self.digits.len() {
            self.digits.push((0, count));
        }
        self.asked += 1;
        self.digits[self.asked - 1].0
    }

    fn lists_multisets(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_odometer_meets_every_combination_once_in_order() {
        let (mut odometer, mut seen) = (Odometer::default(), Vec::new());
        loop {
            let first = odometer.choose(2);
            let second = if first == 0 { odometer.choose(3) } else { 9 };
            seen.push((first, second));
            if !odometer.advance() {
                break;
            }
        }
        assert_eq!(seen, [(0, 0), (0, 1), (0, 2), (1, 9)]);
    }
}
