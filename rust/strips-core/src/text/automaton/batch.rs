//! Many walks at once, in a model's own token ids.

use std::sync::Arc;

use rayon::prelude::*;

use super::{NotAllowed, SpokenTask, Walk};
use crate::text::canonical::{Codec, Word};

/// A token that may not come where it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MaskError {
    /// The row does not allow the token.
    #[error("row {row}: token {token} may not come here")]
    NotAllowed {
        /// The row's number.
        row: usize,
        /// The token.
        token: u32,
    },
    /// There is no such row.
    #[error("there is no row {row}")]
    NoRow {
        /// The number given.
        row: usize,
    },
    /// A word that the walk needs has no token in the model's vocabulary.
    #[error("row {row}: the vocabulary has no token for the word with id {word}")]
    NoToken {
        /// The row's number.
        row: usize,
        /// The word's id in the codec's vocabulary.
        word: Word,
    },
}

/// Walks in rows, told and telling token ids of a model's vocabulary.
#[derive(Clone, Debug)]
pub struct MaskedDecoder {
    /// By word: its token.
    tokens: Vec<Option<u32>>,
    /// By token: its word.
    words: Vec<Option<Word>>,
    walks: Vec<Option<Walk>>,
}

impl MaskedDecoder {
    /// A decoder without rows. `vocabulary` are the model's tokens in the order of their ids.
    pub fn new<S: AsRef<str>>(codec: &Codec, vocabulary: &[S]) -> Self {
        let words: Vec<_> = vocabulary.iter().map(|token| codec.vocabulary().id(token.as_ref())).collect();
        let known = words.iter().flatten().max().map_or(0, |&largest| largest as usize + 1);
        let mut tokens = vec![None; known];
        for (token, word) in words.iter().enumerate() {
            if let Some(word) = word {
                tokens[*word as usize] = Some(token as u32);
            }
        }
        Self { tokens, words, walks: Vec::new() }
    }

    /// Begins a row for each task, numbered on from those before; gives back the tokens forced in each.
    ///
    /// # Errors
    /// [`MaskError::NoToken`] where the vocabulary lacks a word.
    pub fn add(&mut self, tasks: Vec<Arc<SpokenTask>>) -> Result<Vec<Vec<u32>>, MaskError> {
        let started: Vec<_> = tasks.into_par_iter().map(Walk::start).collect();
        let first = self.walks.len();
        let (walks, forced): (Vec<_>, Vec<_>) = started.into_iter().unzip();
        let tokens = forced.iter().enumerate().map(|(row, words)| self.tokens_of(first + row, words)).collect();
        self.walks.extend(walks.into_iter().map(Some));
        tokens
    }

    /// How many rows have been begun.
    pub fn len(&self) -> usize {
        self.walks.len()
    }

    /// Whether no row has been begun.
    pub fn is_empty(&self) -> bool {
        self.walks.is_empty()
    }

    /// Tells each of `rows` (none twice) the token chosen for it; gives back the tokens forced after it.
    ///
    /// # Errors
    /// [`MaskError`] for the first row that does not exist or does not allow its token. The other rows have moved on.
    pub fn advance(&mut self, rows: &[usize], chosen: &[u32]) -> Result<Vec<Vec<u32>>, MaskError> {
        rows.iter().try_for_each(|&row| self.walk(row).map(|_| ()))?;
        let take = |&row: &usize| self.walks[row].take().ok_or(MaskError::NoRow { row });
        let mut taken = rows.iter().map(take).collect::<Result<Vec<_>, _>>()?;
        let words = &self.words;
        let step = |((walk, &token), &row): ((&mut Walk, &u32), &usize)| {
            let word = words.get(token as usize).copied().flatten().ok_or(MaskError::NotAllowed { row, token })?;
            walk.advance(word).map_err(|NotAllowed(_)| MaskError::NotAllowed { row, token })
        };
        // Small batches are done sooner than other threads wake.
        let forced: Vec<_> = taken.par_iter_mut().zip(chosen).zip(rows).with_min_len(16).map(step).collect();
        rows.iter().zip(taken).for_each(|(&row, walk)| self.walks[row] = Some(walk));
        let tokens = forced.into_iter().zip(rows).map(|(words, &row)| self.tokens_of(row, &words?));
        tokens.collect()
    }

    /// Takes steps back in a row that is stuck, as [`Walk::backtrack`] does: the steps left and the tokens forced after them,
    /// or `None` where there is nothing left to try.
    ///
    /// # Errors
    /// [`MaskError`] for a row that does not exist, or a word without a token.
    pub fn backtrack(&mut self, row: usize) -> Result<Option<(usize, Vec<u32>)>, MaskError> {
        let walk = self.walks.get_mut(row).and_then(Option::as_mut).ok_or(MaskError::NoRow { row })?;
        let Some((steps, forced)) = walk.backtrack() else { return Ok(None) };
        Ok(Some((steps, self.tokens_of(row, &forced)?)))
    }

    /// The tokens of a shorter plan than the row's, as [`Walk::shortened`] finds it; `None` where there is none.
    ///
    /// # Errors
    /// [`MaskError`] for a row that does not exist, or a word without a token.
    pub fn shortened(&self, row: usize) -> Result<Option<Vec<u32>>, MaskError> {
        self.walk(row)?.shortened().map(|words| self.tokens_of(row, &words)).transpose()
    }

    /// Writes for each of `rows` a row of flags, one for each token of the vocabulary: whether it may come next.
    ///
    /// # Errors
    /// [`MaskError`] for a row that does not exist, or a word without a token.
    ///
    /// # Panics
    /// When `flags` has not the size of the rows times the vocabulary.
    pub fn mask(&self, rows: &[usize], flags: &mut [bool]) -> Result<(), MaskError> {
        assert_eq!(flags.len(), rows.len() * self.words.len(), "a flag for each token of each row");
        flags.fill(false);
        for (&row, flags) in rows.iter().zip(flags.chunks_exact_mut(self.words.len().max(1))) {
            for word in self.walk(row)?.options() {
                flags[self.token(row, word)? as usize] = true;
            }
        }
        Ok(())
    }

    /// How many tokens the vocabulary has.
    pub fn vocabulary_size(&self) -> usize {
        self.words.len()
    }

    /// The row's walk.
    ///
    /// # Errors
    /// [`MaskError::NoRow`] where there is none.
    pub fn walk(&self, row: usize) -> Result<&Walk, MaskError> {
        self.walks.get(row).and_then(Option::as_ref).ok_or(MaskError::NoRow { row })
    }

    /// Forgets rows; their numbers are not given again.
    pub fn remove(&mut self, rows: &[usize]) {
        for &row in rows {
            if let Some(walk) = self.walks.get_mut(row) {
                *walk = None;
            }
        }
    }

    /// A row of its own that goes on from where `row` is; its number. For beams and several draws.
    ///
    /// # Errors
    /// [`MaskError::NoRow`] where there is no such row.
    pub fn fork(&mut self, row: usize) -> Result<usize, MaskError> {
        let walk = self.walk(row)?.clone();
        self.walks.push(Some(walk));
        Ok(self.walks.len() - 1)
    }

    fn tokens_of(&self, row: usize, words: &[Word]) -> Result<Vec<u32>, MaskError> {
        words.iter().map(|&word| self.token(row, word)).collect()
    }

    fn token(&self, row: usize, word: Word) -> Result<u32, MaskError> {
        self.tokens.get(word as usize).copied().flatten().ok_or(MaskError::NoToken { row, word })
    }
}
