//! The forward pass against a plain one in double precision, and the laws of rows.

use std::sync::Arc;

use proptest::prelude::*;
use strips_decode::{Activation, Affine, Block, Decoder, Model, Norm, Shape};

const EPSILON: f32 = 1e-5;

/// Weights as plain tables, and the pass that anyone would write.
struct Plain {
    shape: Shape,
    blocks: Vec<[Vec<f32>; 12]>,
    tokens: Vec<f32>,
    places: Vec<f32>,
    norm: [Vec<f32>; 2],
    head: Vec<f32>,
}

/// Numbers between -1 and 1 that a seed decides.
struct Draw(u64);

impl Draw {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 40) as f32 / (1 << 23) as f32) - 1.0
    }

    fn many(&mut self, count: usize, scale: f32) -> Vec<f32> {
        (0..count).map(|_| self.next() * scale).collect()
    }
}

impl Plain {
    fn draw(shape: Shape, layers: usize, vocabulary: usize, context: usize, seed: u64) -> Self {
        let (w, inner, mut draw) = (shape.width, 3 * shape.width + 1, Draw(seed));
        let sizes = [w, w, 3 * w * w, 3 * w, w * w, w, w, w, w * inner, inner, inner * w, w];
        let blocks = (0..layers).map(|_| sizes.map(|size| draw.many(size, 0.5))).collect();
        let (tokens, places) = (draw.many(vocabulary * w, 1.0), draw.many(context * w, 1.0));
        let norm = [draw.many(w, 1.0), draw.many(w, 1.0)];
        Self { shape, blocks, tokens, places, norm, head: draw.many(vocabulary * w, 1.0) }
    }

    fn pack(&self) -> Arc<Model> {
        let norm =
            |weight: &Vec<f32>, bias: &Vec<f32>| Norm { weight: weight.clone(), bias: bias.clone(), epsilon: EPSILON };
        let blocks = self.blocks.iter().map(|part| Block {
            norm_1: norm(&part[0], &part[1]),
            attention: Affine { weight: &part[2], bias: &part[3] },
            projection: Affine { weight: &part[4], bias: &part[5] },
            norm_2: norm(&part[6], &part[7]),
            widen: Affine { weight: &part[8], bias: &part[9] },
            narrow: Affine { weight: &part[10], bias: &part[11] },
            scale: self.scale() as f32,
        });
        let last = norm(&self.norm[0], &self.norm[1]);
        Arc::new(Model::new(self.shape, blocks.collect(), &self.tokens, &self.places, last, &self.head))
    }

    fn scale(&self) -> f64 {
        1.0 / ((self.shape.width / self.shape.heads) as f64).sqrt()
    }

    /// Logits after the last of `ids`.
    fn logits(&self, ids: &[usize]) -> Vec<f64> {
        let w = self.shape.width;
        let mut hidden: Vec<Vec<f64>> = ids
            .iter()
            .enumerate()
            .map(|(place, id)| {
                (0..w).map(|i| f64::from(self.tokens[id * w + i] + self.places[place * w + i])).collect()
            })
            .collect();
        for part in &self.blocks {
            let asked: Vec<_> =
                hidden.iter().map(|h| affine(&normed(h, &part[0], &part[1]), &part[2], &part[3])).collect();
            for (at, h) in hidden.iter_mut().enumerate() {
                let mixed = self.attend(&asked, at);
                add(h, &affine(&mixed, &part[4], &part[5]));
                let mut inner = affine(&normed(h, &part[6], &part[7]), &part[8], &part[9]);
                for x in &mut inner {
                    *x = activate(self.shape.activation, *x);
                }
                add(h, &affine(&inner, &part[10], &part[11]));
            }
        }
        let last = normed(hidden.last().expect("a text has a token"), &self.norm[0], &self.norm[1]);
        self.head.chunks(w).map(|row| row.iter().zip(&last).map(|(a, b)| f64::from(*a) * b).sum()).collect()
    }

    fn attend(&self, asked: &[Vec<f64>], at: usize) -> Vec<f64> {
        let (w, size) = (self.shape.width, self.shape.width / self.shape.heads);
        let mut mixed = vec![0.0; w];
        for head in (0..w).step_by(size) {
            let score = |to: usize| -> f64 {
                (head..head + size).map(|i| asked[at][i] * asked[to][w + i]).sum::<f64>() * self.scale()
            };
            let scores: Vec<f64> = (0..=at).map(score).collect();
            let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let total: f64 = scores.iter().map(|s| (s - most).exp()).sum();
            for (to, score) in scores.iter().enumerate() {
                let share = (score - most).exp() / total;
                for i in head..head + size {
                    mixed[i] += share * asked[to][2 * w + i];
                }
            }
        }
        mixed
    }
}

fn affine(x: &[f64], weight: &[f32], bias: &[f32]) -> Vec<f64> {
    let outputs = bias.len();
    (0..outputs)
        .map(|o| {
            f64::from(bias[o]) + x.iter().enumerate().map(|(i, x)| x * f64::from(weight[i * outputs + o])).sum::<f64>()
        })
        .collect()
}

fn normed(x: &[f64], weight: &[f32], bias: &[f32]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / x.len() as f64;
    let scale = 1.0 / (variance + f64::from(EPSILON)).sqrt();
    x.iter().zip(weight).zip(bias).map(|((x, w), b)| (x - mean) * scale * f64::from(*w) + f64::from(*b)).collect()
}

fn add(to: &mut [f64], what: &[f64]) {
    for (to, what) in to.iter_mut().zip(what) {
        *to += what;
    }
}

fn activate(activation: Activation, x: f64) -> f64 {
    match activation {
        Activation::GeluNew => {
            0.5 * x * (1.0 + ((2.0 / std::f64::consts::PI).sqrt() * (x + 0.044_715 * x.powi(3))).tanh())
        }
        Activation::Relu => x.max(0.0),
        Activation::Relu2 => x.max(0.0).powi(2),
    }
}

fn shapes() -> impl Strategy<Value = Shape> {
    let activations = prop_oneof![Just(Activation::GeluNew), Just(Activation::Relu), Just(Activation::Relu2)];
    (1..=4_usize, 1..=19_usize, activations).prop_map(|(heads, size, activation)| Shape {
        width: heads * size,
        heads,
        activation,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn logits_are_those_of_the_plain_pass(
        shape in shapes(), layers in 0..=3_usize, vocabulary in 1..40_usize, seed: u64,
        texts in prop::collection::vec(prop::collection::vec(0..1000_usize, 1..40), 1..20),
    ) {
        let plain = Plain::draw(shape, layers, vocabulary, 40, seed);
        let texts: Vec<Vec<usize>> =
            texts.into_iter().map(|text| text.into_iter().map(|id| id % vocabulary).collect()).collect();
        let mut decoder = Decoder::new(plain.pack(), texts.len());
        let counts: Vec<usize> = texts.iter().map(Vec::len).collect();
        let logits = decoder.feed(0, &texts.concat(), &counts);
        for (text, found) in texts.iter().zip(logits.chunks(vocabulary)) {
            let wanted = plain.logits(text);
            let most = wanted.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
            for (found, wanted) in found.iter().zip(wanted) {
                prop_assert!((f64::from(*found) - wanted).abs() < 1e-4 * most, "{found} for {wanted}");
            }
        }
    }

    /// However rows are fed, copied and cut, each has the logits of its text alone, to the last bit.
    #[test]
    fn a_row_is_its_text_alone(
        shape in shapes(), seed: u64,
        acts in prop::collection::vec((0..4_u8, 0..6_usize, 0..6_usize, prop::collection::vec(0..9_usize, 1..20)), 1..12),
    ) {
        let plain = Plain::draw(shape, 2, 9, 300, seed);
        let model = plain.pack();
        let mut decoder = Decoder::new(Arc::clone(&model), 6);
        let mut texts: Vec<Vec<usize>> = vec![Vec::new(); 6];
        for (act, one, other, ids) in acts {
            match act {
                0 => {
                    decoder.copy(&[one, other], &[other, (other + 1) % 6]);
                    let copied = [texts[one].clone(), texts[other].clone()];
                    let [first, second] = copied;
                    texts[other] = first;
                    texts[(other + 1) % 6] = second;
                }
                1 => {
                    decoder.rewind(one, other);
                    texts[one].truncate(other);
                }
                _ => {
                    let counts = vec![ids.len(); 6 - one];
                    let logits = decoder.feed(one, &ids.repeat(6 - one), &counts);
                    for (row, found) in (one..6).zip(logits.chunks(9)) {
                        texts[row].extend(&ids);
                        let mut alone = Decoder::new(Arc::clone(&model), 1);
                        prop_assert_eq!(&alone.feed(0, &texts[row], &[texts[row].len()])[..], found);
                    }
                }
            }
            for (row, text) in texts.iter().enumerate() {
                prop_assert_eq!(decoder.length(row), text.len());
            }
        }
    }
}
