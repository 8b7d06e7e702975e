//! Products of many tokens with a weight matrix that was packed once.

use pulp::{Arch, Simd, WithSimd};

use crate::pointwise::Activation;
use crate::sheet::{FEW_COLUMNS, Floats, MANY_COLUMNS, Machine, Sheet, has_many_registers, zeros};

/// A linear layer: weights in panels of a few outputs each, in a panel input after input.
#[derive(Debug)]
pub struct Matrix {
    panels: Floats,
    bias: Vec<f32>,
    inputs: usize,
}

/// What becomes of a product.
#[derive(Clone, Copy, Debug)]
pub enum Then {
    /// It replaces what was there.
    Store,
    /// It is added to what was there.
    Add,
    /// It goes through an activation and replaces what was there.
    Activate(Activation),
}

impl Then {
    #[inline(always)]
    fn finish<S: Simd>(self, simd: S, old: S::f32s, sum: S::f32s) -> S::f32s {
        match self {
            Self::Store => sum,
            Self::Add => simd.add_f32s(old, sum),
            Self::Activate(activation) => activation.apply(simd, sum),
        }
    }
}

impl Matrix {
    /// Packs a matrix whose weight from input `i` to output `o` is `weight(i, o)`; `bias` is empty or one number an output.
    pub fn pack(
        inputs: usize,
        outputs: usize,
        weight: impl Fn(usize, usize) -> f32,
        bias: &[f32],
        machine: Machine,
    ) -> Self {
        let columns = machine.columns;
        let count = outputs.div_ceil(columns);
        let mut panels = zeros(count * inputs * columns);
        for (index, panel) in panels.chunks_exact_mut(inputs * columns).enumerate() {
            for (input, row) in panel.chunks_exact_mut(columns).enumerate() {
                for (output, spot) in (index * columns..outputs).zip(row) {
                    *spot = weight(input, output);
                }
            }
        }
        let mut padded = bias.to_vec();
        padded.resize(count * columns, 0.0);
        Self { panels, bias: padded, inputs }
    }

    /// The layer's output for every token of `input`, into `output`.
    pub fn product(&self, input: &Sheet, output: &mut Sheet, then: Then) {
        Arch::new().dispatch(Product { matrix: self, input, output, then });
    }
}

struct Product<'a> {
    matrix: &'a Matrix,
    input: &'a Sheet,
    output: &'a mut Sheet,
    then: Then,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if has_many_registers::<S>() {
            self.panels::<S, MANY_COLUMNS>(simd);
        } else {
            self.panels::<S, FEW_COLUMNS>(simd);
        }
    }
}

impl Product<'_> {
    #[inline(always)]
    fn panels<S: Simd, const C: usize>(self, simd: S) {
        let Self { matrix, input, output, then } = self;
        let inputs = matrix.inputs;
        let (from, to) = (input.features * input.block, output.features * output.block);
        for (index, (panel, bias)) in
            matrix.panels.chunks_exact(inputs * C).zip(matrix.bias.chunks_exact(C)).enumerate()
        {
            let first = index * C * output.block;
            for (read, write) in input.floats.chunks_exact(from).zip(output.floats.chunks_exact_mut(to)) {
                let tokens = S::as_simd_f32s(&read[..inputs * input.block]).0;
                let sums = sums::<S, C>(simd, tokens, panel);
                let spots = S::as_mut_simd_f32s(&mut write[first..first + C * output.block]).0;
                for ((pair, sum), &bias) in spots.chunks_exact_mut(2).zip(sums).zip(bias) {
                    let bias = simd.splat_f32s(bias);
                    pair[0] = then.finish(simd, pair[0], simd.add_f32s(sum[0], bias));
                    pair[1] = then.finish(simd, pair[1], simd.add_f32s(sum[1], bias));
                }
            }
        }
    }
}

/// `C` outputs of one block of tokens.
#[inline(always)]
fn sums<S: Simd, const C: usize>(simd: S, tokens: &[S::f32s], panel: &[f32]) -> [[S::f32s; 2]; C] {
    let mut sums = [[simd.splat_f32s(0.0); 2]; C];
    for (token, weights) in tokens.chunks_exact(2).zip(panel.chunks_exact(C)) {
        for (sum, &weight) in sums.iter_mut().zip(weights) {
            let weight = simd.splat_f32s(weight);
            sum[0] = simd.mul_add_e_f32s(token[0], weight, sum[0]);
            sum[1] = simd.mul_add_e_f32s(token[1], weight, sum[1]);
        }
    }
    sums
}
