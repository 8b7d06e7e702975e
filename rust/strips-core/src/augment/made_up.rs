//! Made-up words that a person could pronounce: what teaches a model to copy names instead of knowing them.

use super::lexicon::Hold;
use crate::random::Random;

const ONSETS: [&str; 22] =
    ["b", "d", "f", "g", "h", "j", "k", "l", "m", "n", "p", "r", "s", "t", "v", "w", "z", "br", "dr", "kl", "pl", "tr"];
const VOWELS: [&str; 6] = ["a", "e", "i", "o", "u", "oo"];
const CODAS: [&str; 9] = ["", "", "", "n", "l", "r", "s", "m", "k"];

/// One word in this many is held out of training.
const HELD_OUT_OF: u64 = 8;

/// A word of two or three syllables, `bramok` say, from the trained or the held-out words.
///
/// Which of the two a word belongs to depends on the word alone, so training never meets a held-out one.
pub fn made_up_word(random: &mut Random, hold: Hold) -> String {
    loop {
        let word = any_word(random);
        if side(&word) == hold {
            return word;
        }
    }
}

fn any_word(random: &mut Random) -> String {
    let syllables = 2 + random.below(2);
    (0..syllables).flat_map(|_| [*random.choice(&ONSETS), *random.choice(&VOWELS), *random.choice(&CODAS)]).collect()
}

/// The side that the word belongs to, by a hash that is fixed for ever (FNV-1a).
fn side(word: &str) -> Hold {
    let fold = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01B3);
    let hash = word.bytes().fold(0xCBF2_9CE4_8422_2325, fold);
    if (hash >> 32) % HELD_OUT_OF == 0 { Hold::HeldOut } else { Hold::Trained }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn training_never_draws_a_held_out_word() {
        let mut random = Random::new(0, 0);
        let mut draw =
            |hold| (0..2_000).map(|_| made_up_word(&mut random, hold)).collect::<std::collections::HashSet<_>>();
        let (trained, held_out) = (draw(Hold::Trained), draw(Hold::HeldOut));
        assert!(trained.is_disjoint(&held_out));
        assert!(trained.len() > 1_500 && held_out.len() > 1_500, "{} {}", trained.len(), held_out.len());
    }
}
