//! One head of one row: where its numbers are among all tokens', and how they are laid out to work on.

use super::products::grow;
use super::{Number, Rows};
use crate::sheet::Floats;

/// One head of one row.
#[derive(Clone, Copy)]
pub struct Head {
    /// The row's first token.
    pub first: usize,
    /// The row's tokens.
    pub tokens: usize,
    /// Which of the heads it is.
    pub number: usize,
    /// Numbers in a head.
    pub size: usize,
    /// The same, padded to whole blocks.
    pub padded: usize,
    /// Queries in a block: two registers' worth.
    pub block: usize,
}

impl Rows<'_> {
    /// Every head of every row.
    pub(super) fn each_head(&self, block: usize) -> impl Iterator<Item = Head> {
        let padded = self.size.next_multiple_of(block);
        self.bounds.windows(2).flat_map(move |bounds| {
            let (first, tokens) = (bounds[0], bounds[1] - bounds[0]);
            (0..self.heads).map(move |number| Head { first, tokens, number, size: self.size, padded, block })
        })
    }
}

impl Head {
    /// The first of its numbers in a token's query; and in what is mixed.
    pub fn column(self) -> usize {
        self.number * self.size
    }

    /// How many keys the block of queries from `first` on sees: none behind its last query.
    pub fn keys(self, first: usize) -> usize {
        (first + self.block).min(self.tokens)
    }

    /// Tokens, up to whole blocks.
    pub fn room(self) -> usize {
        self.tokens.next_multiple_of(self.block)
    }

    /// Copies a matrix's numbers, (tokens, padded), times `scale`; `across` numbers are from token to token.
    #[inline(always)]
    pub fn read<N: Number>(self, from: &[N], across: usize, column: usize, scale: f32, into: &mut Floats) {
        grow(into, self.room() * self.padded);
        let rows = from[self.first * across..].chunks(across).take(self.tokens);
        for (row, spots) in rows.zip(into.chunks_exact_mut(self.padded)) {
            for (spot, number) in spots.iter_mut().zip(&row[column..column + self.size]) {
                *spot = number.widen() * scale;
            }
            spots[self.size..].fill(0.0);
        }
    }

    /// The block of `matrix` from token `first` on, turned around: (size, block), zeros for tokens that are none.
    #[inline(always)]
    pub fn turn(self, matrix: &[f32], first: usize, turned: &mut Floats) {
        grow(turned, self.size * self.block);
        let real = self.keys(first) - first;
        let matrix = &matrix[first * self.padded..];
        for (column, spots) in turned.chunks_exact_mut(self.block).take(self.size).enumerate() {
            for (token, spot) in spots[..real].iter_mut().enumerate() {
                *spot = matrix[token * self.padded + column];
            }
            spots[real..].fill(0.0);
        }
    }
}
