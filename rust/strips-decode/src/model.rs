//! The model, and rows of text that go through it.

use std::sync::Arc;

use crate::attend::{Attend, Cache, Heads};
use crate::matrix::{Matrix, Then};
pub use crate::pointwise::{Activation, Norm};
use crate::sheet::{Machine, Sheet, zeros};

/// Sizes that weights do not tell.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Numbers a token has between layers.
    pub width: usize,
    /// Heads of a layer's attention.
    pub heads: usize,
    /// The activation of inner layers.
    pub activation: Activation,
}

/// A linear layer as GPT-2 stores it: weights (inputs, outputs), and a bias (outputs).
#[derive(Clone, Copy, Debug)]
pub struct Affine<'a> {
    /// (inputs, outputs), row after row.
    pub weight: &'a [f32],
    /// (outputs).
    pub bias: &'a [f32],
}

impl Affine<'_> {
    fn pack(self, machine: Machine) -> Matrix {
        let outputs = self.bias.len();
        let inputs = self.weight.len() / outputs;
        Matrix::pack(inputs, outputs, |i, o| self.weight[i * outputs + o], self.bias, machine)
    }
}

/// One transformer block's weights.
#[derive(Debug)]
pub struct Block<'a> {
    /// Before attention.
    pub norm_1: Norm,
    /// To queries, keys and values, (width, 3 * width).
    pub attention: Affine<'a>,
    /// From what was attended to, (width, width).
    pub projection: Affine<'a>,
    /// Before the inner layer.
    pub norm_2: Norm,
    /// (width, inner).
    pub widen: Affine<'a>,
    /// (inner, width).
    pub narrow: Affine<'a>,
    /// Factor of attention's scores.
    pub scale: f32,
}

#[derive(Debug)]
struct Layer {
    norm_1: Norm,
    attention: Matrix,
    projection: Matrix,
    norm_2: Norm,
    widen: Matrix,
    narrow: Matrix,
    inner: usize,
    heads: Heads,
}

/// Weights, packed for this machine.
#[derive(Debug)]
pub struct Model {
    shape: Shape,
    layers: Vec<Layer>,
    tokens: Vec<f32>,
    places: Vec<f32>,
    norm: Norm,
    head: Matrix,
    machine: Machine,
}

impl Model {
    /// Packs the weights; `tokens` (vocabulary, width) and `places` (positions, width) are what a token begins as, `head`
    /// is (vocabulary, width).
    pub fn new(shape: Shape, blocks: Vec<Block<'_>>, tokens: &[f32], places: &[f32], norm: Norm, head: &[f32]) -> Self {
        let machine = Machine::here();
        let width = shape.width;
        let layers = blocks
            .into_iter()
            .map(|block| Layer {
                norm_1: block.norm_1,
                attention: block.attention.pack(machine),
                projection: block.projection.pack(machine),
                norm_2: block.norm_2,
                widen: block.widen.pack(machine),
                narrow: block.narrow.pack(machine),
                inner: block.widen.bias.len(),
                heads: Heads { count: shape.heads, size: width / shape.heads, scale: block.scale },
            })
            .collect();
        let head = Matrix::pack(width, head.len() / width, |i, o| head[o * width + i], &[], machine);
        Self { shape, layers, tokens: tokens.to_vec(), places: places.to_vec(), norm, head, machine }
    }

    /// Tokens that there are.
    pub fn vocabulary(&self) -> usize {
        self.tokens.len() / self.shape.width
    }

    /// Positions that there are.
    pub fn context(&self) -> usize {
        self.places.len() / self.shape.width
    }
}

/// What is kept of one row.
#[derive(Clone, Debug)]
struct Row {
    length: usize,
    caches: Vec<Cache>,
}

impl Row {
    fn empty(layers: usize) -> Self {
        Self { length: 0, caches: vec![Cache::new(); layers] }
    }
}

/// Rows of text, each as long as it is.
#[derive(Debug)]
pub struct Decoder {
    model: Arc<Model>,
    rows: Vec<Arc<Row>>,
}

impl Decoder {
    /// So many empty rows.
    pub fn new(model: Arc<Model>, rows: usize) -> Self {
        let layers = model.layers.len();
        Self { model, rows: (0..rows).map(|_| Arc::new(Row::empty(layers))).collect() }
    }

    /// Tokens in a row.
    pub fn length(&self, row: usize) -> usize {
        self.rows[row].length
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Forgets the tokens of a row but the first `count`.
    pub fn rewind(&mut self, row: usize, count: usize) {
        let row = &mut self.rows[row];
        if count == 0 && Arc::get_mut(row).is_none() {
            *row = Arc::new(Row::empty(self.model.layers.len()));
        }
        let own = Arc::make_mut(row);
        own.length = own.length.min(count);
    }

    /// Copies rows over rows, all at once: what is copied is what was there before. A copy costs nothing until one of the
    /// two goes on, or only one is left.
    pub fn copy(&mut self, sources: &[usize], targets: &[usize]) {
        let taken: Vec<_> = sources.iter().map(|&row| Arc::clone(&self.rows[row])).collect();
        for (row, &target) in taken.into_iter().zip(targets) {
            self.rows[target] = row;
        }
    }

    /// Appends tokens to the rows from `first` on, and gives the logits after the last of each, (rows, vocabulary).
    ///
    /// `counts` says how many of `ids` each row gets, at least one. A row that is longer than the model's context has its
    /// last tokens at the last position.
    pub fn feed(&mut self, first: usize, ids: &[usize], counts: &[usize]) -> Vec<f32> {
        let model = Arc::clone(&self.model);
        let mut hidden = self.embed(first, ids, counts);
        let last = model.layers.len().checked_sub(1);
        for (index, layer) in model.layers.iter().enumerate() {
            hidden = self.block(index, layer, hidden, first, counts, last == Some(index));
        }
        if last.is_none() {
            hidden = pick(&hidden, &ends(counts), model.machine);
        }
        for (row, &count) in (first..).zip(counts) {
            Arc::make_mut(&mut self.rows[row]).length += count;
        }
        let (texts, vocabulary) = (counts.len(), model.vocabulary());
        let mut normed = Sheet::new(texts, model.shape.width, model.machine);
        model.norm.apply(&hidden, &mut normed);
        let mut found = Sheet::new(texts, vocabulary, model.machine);
        model.head.product(&normed, &mut found, Then::Store);
        let mut logits = vec![0.0; texts * vocabulary];
        for (text, row) in logits.chunks_exact_mut(vocabulary).enumerate() {
            for (spot, logit) in row.iter_mut().zip(found.get(text, 0)) {
                *spot = logit;
            }
        }
        logits
    }

    fn embed(&self, first: usize, ids: &[usize], counts: &[usize]) -> Sheet {
        let (model, width) = (&*self.model, self.model.shape.width);
        let mut hidden = Sheet::new(ids.len(), width, model.machine);
        let places = (first..).zip(counts).flat_map(|(row, &count)| (self.length(row)..).take(count));
        for (token, (&id, place)) in ids.iter().zip(places).enumerate() {
            let place = place.min(model.context() - 1);
            let (word, spot) = (&model.tokens[id * width..], &model.places[place * width..]);
            hidden.set(token, word.iter().zip(spot).take(width).map(|(a, b)| a + b));
        }
        hidden
    }

    /// One transformer block; after the attention, of each row's last token alone where `ending`.
    fn block(
        &mut self,
        index: usize,
        layer: &Layer,
        hidden: Sheet,
        first: usize,
        counts: &[usize],
        ending: bool,
    ) -> Sheet {
        let (machine, width) = (self.model.machine, self.model.shape.width);
        let tokens: usize = counts.iter().sum();
        let mut normed = Sheet::new(tokens, width, machine);
        layer.norm_1.apply(&hidden, &mut normed);
        let mut asked = Sheet::new(tokens, 3 * width, machine);
        layer.attention.product(&normed, &mut asked, Then::Store);
        let wanted = if ending { ends(counts) } else { (0..tokens).collect() };
        let mut hidden = if ending { pick(&hidden, &wanted, machine) } else { hidden };
        let mut mixed = Sheet::new(wanted.len(), width, machine);
        self.attend(index, layer, &asked, first, counts, ending, &mut mixed);
        layer.projection.product(&mixed, &mut hidden, Then::Add);
        let mut normed = Sheet::new(wanted.len(), width, machine);
        layer.norm_2.apply(&hidden, &mut normed);
        let mut inner = Sheet::new(wanted.len(), layer.inner, machine);
        layer.widen.product(&normed, &mut inner, Then::Activate(self.model.shape.activation));
        layer.narrow.product(&inner, &mut hidden, Then::Add);
        hidden
    }

    /// Writes the new keys and values of layer `index`, then mixes for every token, or each row's last where `ending`.
    #[expect(clippy::too_many_arguments, reason = "all of them are a call's own")]
    fn attend(
        &mut self,
        index: usize,
        layer: &Layer,
        asked: &Sheet,
        first: usize,
        counts: &[usize],
        ending: bool,
        mixed: &mut Sheet,
    ) {
        let (machine, width, heads) = (self.model.machine, self.model.shape.width, layer.heads);
        let padded = heads.size.next_multiple_of(machine.lanes);
        let mut query = vec![0.0; width];
        let (mut scores, mut out) = (zeros(0), zeros(heads.count * padded));
        let (mut token, mut written) = (0, 0);
        for (row, &count) in (first..).zip(counts) {
            let row = Arc::make_mut(&mut self.rows[row]);
            let cache = &mut row.caches[index];
            for i in 0..count {
                let (key, value) = (asked.get(token + i, width), asked.get(token + i, 2 * width));
                cache.put(row.length + i, key, value, heads, machine);
            }
            for i in if ending { count - 1..count } else { 0..count } {
                for (spot, number) in query.iter_mut().zip(asked.get(token + i, 0)) {
                    *spot = number;
                }
                let positions = row.length + i + 1;
                Attend { cache, query: &query, positions, heads, scores: &mut scores, mixed: &mut out }.run();
                mixed.set(written, out.chunks_exact(padded).flat_map(|head| head[..heads.size].iter().copied()));
                written += 1;
            }
            token += count;
        }
    }
}

/// Of rows with so many tokens each the last tokens.
fn ends(counts: &[usize]) -> Vec<usize> {
    let mut end = 0;
    counts
        .iter()
        .map(|count| {
            end += count;
            end - 1
        })
        .collect()
}

/// Some of the tokens of a sheet.
fn pick(sheet: &Sheet, tokens: &[usize], machine: Machine) -> Sheet {
    let mut picked = Sheet::new(tokens.len(), sheet.features, machine);
    for (to, &from) in tokens.iter().enumerate() {
        picked.set(to, sheet.get(from, 0).take(sheet.features));
    }
    picked
}
