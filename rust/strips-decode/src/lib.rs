//! GPT-2's forward pass on one core, for decoding small models in large batches.
//!
//! A model of a hundred features a layer spends more time between matrix products than in them. Here the vector lanes of
//! the processor run over tokens, not over features: layer norms, activations and residuals need no sums across lanes, a
//! product's output is the next one's input as it stands, and weights are packed once. Only attention, which is each
//! row's own, sees one token at a time. What a token's logits are depends on its row alone, to the last bit: not on the
//! rows beside it, and not on how the row was cut into calls.
//!
//! It knows token ids and weights; no text, no choice of tokens, no planning.
//!
//! Training has its layers from elsewhere and only its attention from here: [`attend`] and [`attend_back`].

#![allow(
    clippy::inline_always,
    reason = "vector instructions are only used in what is inlined where they are known to be there"
)]

mod attend;
mod matrix;
mod model;
mod pointwise;
mod sheet;
mod training;

pub use model::{Activation, Affine, Block, Decoder, Model, Norm, Shape};
pub use training::{Number, Rows, attend, attend_back};
