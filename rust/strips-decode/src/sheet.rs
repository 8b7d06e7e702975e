//! Numbers of many tokens, feature by feature: what one layer hands to the next.

use aligned_vec::{AVec, ConstAlign};
use pulp::{Arch, Simd, WithSimd};

/// Floats that begin where a vector register may be loaded in one piece.
pub type Floats = AVec<f32, ConstAlign<64>>;

/// `count` zeros.
pub fn zeros(count: usize) -> Floats {
    let mut floats = Floats::with_capacity(64, count);
    floats.resize(count, 0.0);
    floats
}

/// How wide the vector registers of this machine are, and how many accumulators a product may keep in them.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// Floats in a register.
    pub lanes: usize,
    /// Outputs that a product makes at once.
    pub columns: usize,
}

/// Outputs of a product at once where there are 32 registers: 16 sums, 2 inputs, 1 weight.
pub const MANY_COLUMNS: usize = 8;
/// Outputs of a product at once where there are 16 registers: 12 sums, 2 inputs, 1 weight.
pub const FEW_COLUMNS: usize = 6;

/// Whether there are registers for [`MANY_COLUMNS`].
pub const fn has_many_registers<S: Simd>() -> bool {
    S::REGISTER_COUNT >= 32
}

impl Machine {
    /// Of this machine.
    pub fn here() -> Self {
        struct Ask;
        impl WithSimd for Ask {
            type Output = Machine;

            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> Machine {
                let columns = if has_many_registers::<S>() { MANY_COLUMNS } else { FEW_COLUMNS };
                Machine { lanes: S::F32_LANES, columns }
            }
        }
        Arch::new().dispatch(Ask)
    }
}

/// (tokens, features) in blocks of two registers' worth of tokens: block after block, in a block feature after feature.
#[derive(Debug)]
pub struct Sheet {
    /// All numbers; those of tokens and features that are none are zero or arbitrary, and never read back.
    pub floats: Floats,
    /// Features, padded to what products write at once.
    pub features: usize,
    /// Tokens in a block.
    pub block: usize,
}

impl Sheet {
    /// Zeros for so many tokens of so many features.
    pub fn new(tokens: usize, features: usize, machine: Machine) -> Self {
        let block = 2 * machine.lanes;
        let features = features.next_multiple_of(machine.columns);
        Self { floats: zeros(tokens.div_ceil(block) * block * features), features, block }
    }

    /// Where a token's first feature stands; its next ones follow `block` apart.
    pub fn place(&self, token: usize) -> usize {
        token / self.block * self.block * self.features + token % self.block
    }

    /// Writes a token's first features.
    pub fn set(&mut self, token: usize, features: impl IntoIterator<Item = f32>) {
        let start = self.place(token);
        for (spot, value) in self.floats[start..].iter_mut().step_by(self.block).zip(features) {
            *spot = value;
        }
    }

    /// A token's features from `first` on.
    pub fn get(&self, token: usize, first: usize) -> impl Iterator<Item = f32> {
        self.floats[self.place(token) + first * self.block..].iter().step_by(self.block).copied()
    }
}
