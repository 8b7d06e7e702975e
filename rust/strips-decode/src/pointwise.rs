//! What happens to each number, or to each token's numbers, alone.

use pulp::{Arch, Simd, WithSimd};

use crate::sheet::Sheet;

/// What a block's inner layer goes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// GPT-2's: GELU by way of the hyperbolic tangent (Hendrycks and Gimpel 2016).
    GeluNew,
    /// The positive part.
    Relu,
    /// The positive part, squared (So et al. 2021).
    Relu2,
}

impl Activation {
    /// Of each number in a register.
    #[inline(always)]
    pub fn apply<S: Simd>(self, simd: S, x: S::f32s) -> S::f32s {
        let positive = simd.max_f32s(x, simd.splat_f32s(0.0));
        match self {
            Self::GeluNew => gelu_new(simd, x),
            Self::Relu => positive,
            Self::Relu2 => simd.mul_f32s(positive, positive),
        }
    }
}

/// `x / (1 + exp(-2 sqrt(2 / π) (x + 0.044715 x³)))`, which is the usual form with the hyperbolic tangent written out.
#[inline(always)]
fn gelu_new<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    const SCALE: f32 = -2.0 * 0.797_884_6;
    let square = simd.mul_f32s(x, x);
    let inner = simd.mul_add_e_f32s(square, simd.splat_f32s(0.044_715 * SCALE), simd.splat_f32s(SCALE));
    let below = simd.add_f32s(exp(simd, simd.mul_f32s(x, inner)), simd.splat_f32s(1.0));
    simd.div_f32s(x, below)
}

/// The exponential, within 2 units in the last place from -87 to 88, and clamped to those ends beyond.
///
/// The usual way: `exp(x) = 2^n exp(r)` with `r` within half a logarithm of 2 around zero, and a polynomial for the latter
/// (Taylor's of degree 7: 3e-9 at the ends).
#[inline(always)]
pub fn exp<S: Simd>(simd: S, x: S::f32s) -> S::f32s {
    /// Added to a small number it leaves it rounded to a whole one, in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    const HIGH: f32 = 0.693_359_4;
    const LOW: f32 = -2.121_944_4e-4;
    const TAYLOR: [f32; 7] = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];
    let x = simd.min_f32s(simd.max_f32s(x, simd.splat_f32s(-87.0)), simd.splat_f32s(88.0));
    let shifted = simd.mul_add_e_f32s(x, simd.splat_f32s(std::f32::consts::LOG2_E), simd.splat_f32s(ROUND));
    let whole = simd.sub_f32s(shifted, simd.splat_f32s(ROUND));
    let rest = simd.mul_add_e_f32s(whole, simd.splat_f32s(-HIGH), x);
    let rest = simd.mul_add_e_f32s(whole, simd.splat_f32s(-LOW), rest);
    let mut sum = simd.splat_f32s(1.0 / 5040.0);
    for factor in TAYLOR {
        sum = simd.mul_add_e_f32s(sum, rest, simd.splat_f32s(factor));
    }
    let bits = simd.wrapping_dyn_shl_u32s(simd.transmute_u32s_f32s(shifted), simd.splat_u32s(23));
    simd.transmute_f32s_u32s(simd.add_u32s(simd.transmute_u32s_f32s(sum), bits))
}

/// A layer norm's weights (Ba et al. 2016).
#[derive(Debug)]
pub struct Norm {
    /// (features) factors.
    pub weight: Vec<f32>,
    /// (features) summands.
    pub bias: Vec<f32>,
    /// Added to the variance.
    pub epsilon: f32,
}

impl Norm {
    /// Every token of `input` normed, into `output`.
    pub fn apply(&self, input: &Sheet, output: &mut Sheet) {
        Arch::new().dispatch(Apply { norm: self, input, output });
    }
}

struct Apply<'a> {
    norm: &'a Norm,
    input: &'a Sheet,
    output: &'a mut Sheet,
}

impl WithSimd for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { norm, input, output } = self;
        let size = norm.weight.len();
        let share = simd.splat_f32s(1.0 / size as f32);
        let (from, to) = (input.features * input.block, output.features * output.block);
        for (read, write) in input.floats.chunks_exact(from).zip(output.floats.chunks_exact_mut(to)) {
            let read = S::as_simd_f32s(&read[..size * input.block]).0;
            let write = S::as_mut_simd_f32s(&mut write[..size * output.block]).0;
            let mut mean = [simd.splat_f32s(0.0); 2];
            for pair in read.chunks_exact(2) {
                mean = [simd.add_f32s(mean[0], pair[0]), simd.add_f32s(mean[1], pair[1])];
            }
            let mean = [simd.mul_f32s(mean[0], share), simd.mul_f32s(mean[1], share)];
            let mut spread = [simd.splat_f32s(0.0); 2];
            for pair in read.chunks_exact(2) {
                for i in 0..2 {
                    let off = simd.sub_f32s(pair[i], mean[i]);
                    spread[i] = simd.mul_add_e_f32s(off, off, spread[i]);
                }
            }
            let scale =
                [deviation(simd, spread[0], share, norm.epsilon), deviation(simd, spread[1], share, norm.epsilon)];
            for (((pair, out), &weight), &bias) in
                read.chunks_exact(2).zip(write.chunks_exact_mut(2)).zip(&norm.weight).zip(&norm.bias)
            {
                let (weight, bias) = (simd.splat_f32s(weight), simd.splat_f32s(bias));
                for i in 0..2 {
                    let normed = simd.mul_f32s(simd.sub_f32s(pair[i], mean[i]), scale[i]);
                    out[i] = simd.mul_add_e_f32s(normed, weight, bias);
                }
            }
        }
    }
}

/// One over the standard deviation, from a sum of squares.
#[inline(always)]
fn deviation<S: Simd>(simd: S, sum: S::f32s, share: S::f32s, epsilon: f32) -> S::f32s {
    let variance = simd.mul_add_e_f32s(sum, share, simd.splat_f32s(epsilon));
    simd.div_f32s(simd.splat_f32s(1.0), simd.sqrt_f32s(variance))
}
