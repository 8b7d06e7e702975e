//! One head of one row: where its numbers are among all tokens', and how they are laid out to work on.

use super::products::grow;
use super::{Number, Rows};
use crate::sheet::Floats;

/// One head of one row.
#[derive(Clone, Copy)]
pub struct Head {
    /// The first of the row's own tokens.
    pub first: usize,
    /// The row's tokens, borrowed ones and its own.
    pub tokens: usize,
    /// How many of them are borrowed; they come first.
    pub borrowed: usize,
    /// The first of the tokens that it borrows.
    lent: usize,
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
    /// Every head of every row, those of a family together: first of the rows that borrow, then of the one that lends.
    pub(super) fn each_head(&self, block: usize) -> impl Iterator<Item = Head> {
        let padded = self.size.next_multiple_of(block);
        self.families().flat_map(move |family| {
            let lent = self.bounds[family.start];
            let of = move |number, row| {
                let (first, borrowed) = (self.bounds[row], self.borrows(row));
                let tokens = borrowed + self.bounds[row + 1] - first;
                Head { first, tokens, borrowed, lent, number, size: self.size, padded, block }
            };
            (0..self.heads).flat_map(move |number| family.clone().rev().map(move |row| of(number, row)))
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

    /// How many of the row's tokens are its own.
    pub fn own(self) -> usize {
        self.tokens - self.borrowed
    }

    /// Copies a matrix's numbers, (tokens, padded); `across` numbers are from token to token.
    #[inline(always)]
    pub fn read<N: Number>(self, from: &[N], across: usize, column: usize, into: &mut Floats) {
        self.read_own(from, across, column, 1.0, into);
        let lent = from[self.lent * across..].chunks(across).take(self.borrowed);
        self.copy(lent, column, 1.0, into);
    }

    /// Copies those of the row's own tokens, times `scale`; the places of the others keep what they have.
    #[inline(always)]
    pub fn read_own<N: Number>(self, from: &[N], across: usize, column: usize, scale: f32, into: &mut Floats) {
        grow(into, self.room() * self.padded);
        let own = from[self.first * across..].chunks(across).take(self.own());
        self.copy(own, column, scale, &mut into[self.borrowed * self.padded..]);
    }

    #[inline(always)]
    fn copy<'n, N: Number + 'n>(
        self,
        rows: impl Iterator<Item = &'n [N]>,
        column: usize,
        scale: f32,
        into: &mut [f32],
    ) {
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
