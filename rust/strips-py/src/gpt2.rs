//! Decoding of small GPT-2 models on one core.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use strips_decode::{Activation, Affine, Block, Decoder, Model, Norm, Shape};

type Floats<'py> = PyReadonlyArrayDyn<'py, f32>;

/// A GPT-2's weights, packed for this processor.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Gpt2Weights {
    core: Arc<Model>,
}

#[pymethods]
impl Gpt2Weights {
    /// Packs the weights. Of each of `blocks` the arrays are, in this order, weight and bias of: the first norm, the
    /// attention's inputs, its projection, the second norm, the inner layer, and the way back; `scales` are the factors of
    /// attention's scores. `tokens` (vocabulary, width) and `places` (positions, width) are what a token begins as, `norm`
    /// is the last one, `head` is (vocabulary, width).
    #[new]
    #[pyo3(signature = (blocks, tokens, places, norm, head, *, heads, scales, activation, epsilon))]
    #[expect(clippy::too_many_arguments, reason = "a model has that many parts, and keywords tell them apart")]
    fn new(
        blocks: Vec<Vec<Floats<'_>>>,
        tokens: Floats<'_>,
        places: Floats<'_>,
        norm: [Floats<'_>; 2],
        head: Floats<'_>,
        heads: usize,
        scales: Vec<f32>,
        activation: &str,
        epsilon: f32,
    ) -> PyResult<Self> {
        let activation = match activation {
            "gelu_new" => Activation::GeluNew,
            "relu" => Activation::Relu,
            "relu2" => Activation::Relu2,
            other => return Err(PyValueError::new_err(format!("no activation `{other}`"))),
        };
        let width = norm[0].len()?;
        let parts = blocks.iter().map(|block| block.iter().map(floats).collect::<PyResult<Vec<_>>>());
        let parts = parts.collect::<PyResult<Vec<_>>>()?;
        let (tokens, places, head) = (floats(&tokens)?, floats(&places)?, floats(&head)?);
        let inner = parts.first().and_then(|block| block.get(9)).map_or(0, |bias| bias.len());
        let sizes = [
            width,
            width,
            width * 3 * width,
            3 * width,
            width * width,
            width,
            width,
            width,
            width * inner,
            inner,
            inner * width,
            width,
        ];
        let fit = |block: &Vec<&[f32]>| block.iter().map(|part| part.len()).eq(sizes);
        let whole = |part: &[f32]| !part.is_empty() && part.len().is_multiple_of(width);
        if width == 0
            || heads == 0
            || !width.is_multiple_of(heads)
            || scales.len() != parts.len()
            || !parts.iter().all(fit)
            || !whole(tokens)
            || !whole(places)
            || tokens.len() != head.len()
            || norm[1].len()? != width
        {
            return Err(PyValueError::new_err("the weights' shapes do not fit each other"));
        }
        let made_norm = |weight: &[f32], bias: &[f32]| Norm { weight: weight.to_vec(), bias: bias.to_vec(), epsilon };
        let blocks = parts.iter().zip(scales).map(|(part, scale)| Block {
            norm_1: made_norm(part[0], part[1]),
            attention: Affine { weight: part[2], bias: part[3] },
            projection: Affine { weight: part[4], bias: part[5] },
            norm_2: made_norm(part[6], part[7]),
            widen: Affine { weight: part[8], bias: part[9] },
            narrow: Affine { weight: part[10], bias: part[11] },
            scale,
        });
        let last = made_norm(floats(&norm[0])?, floats(&norm[1])?);
        let shape = Shape { width, heads, activation };
        Ok(Self { core: Arc::new(Model::new(shape, blocks.collect(), tokens, places, last, head)) })
    }

    /// Positions that the model has.
    #[getter]
    fn context(&self) -> usize {
        self.core.context()
    }
}

/// The numbers of an array, which must lie one after the other.
fn floats<'a>(array: &'a Floats<'_>) -> PyResult<&'a [f32]> {
    array.as_slice().map_err(|_| PyValueError::new_err("an array is not contiguous"))
}

/// Rows of text that go through a model: what was read of each is kept.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Gpt2Rows {
    core: Mutex<Decoder>,
    vocabulary: usize,
}

#[pymethods]
impl Gpt2Rows {
    /// So many rows that have read nothing.
    #[new]
    fn new(weights: &Gpt2Weights, rows: usize) -> Self {
        let core = Mutex::new(Decoder::new(Arc::clone(&weights.core), rows));
        Self { core, vocabulary: weights.core.vocabulary() }
    }

    /// Appends tokens to the rows from `first` on, and gives the logits after the last of each, (rows, vocabulary). Of `ids`
    /// (rows, longest) each row gets its first `counts`, at least one.
    fn feed<'py>(
        &self,
        py: Python<'py>,
        first: usize,
        ids: PyReadonlyArrayDyn<'py, i64>,
        counts: PyReadonlyArrayDyn<'py, i64>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let counts: Vec<usize> = counts.as_array().iter().map(|&count| usize::try_from(count).unwrap_or(0)).collect();
        let table = ids.as_array();
        let longest = table.shape().last().copied().unwrap_or(0);
        let rows = counts.len();
        if table.shape() != [rows, longest] || counts.iter().any(|&count| count == 0 || count > longest) {
            return Err(PyValueError::new_err(
                "`counts` says for each row of `ids` how many tokens it has, at least one",
            ));
        }
        if first.checked_add(rows).is_none_or(|end| end > self.core().len()) {
            return Err(PyValueError::new_err("there are not so many rows"));
        }
        let mut tokens = Vec::with_capacity(counts.iter().sum());
        for (row, &count) in table.rows().into_iter().zip(&counts) {
            for &id in row.iter().take(count) {
                let id = usize::try_from(id).ok().filter(|&id| id < self.vocabulary);
                tokens.push(id.ok_or_else(|| PyValueError::new_err("a token is none of the vocabulary"))?);
            }
        }
        let logits = py.detach(|| self.core().feed(first, &tokens, &counts));
        PyArray1::from_vec(py, logits).reshape([rows, self.vocabulary])
    }

    /// Copies rows over rows, all at once.
    #[pyo3(name = "move")]
    fn copy(&self, sources: Vec<usize>, targets: Vec<usize>) -> PyResult<()> {
        self.check(sources.iter().chain(&targets))?;
        self.core().copy(&sources, &targets);
        Ok(())
    }

    /// Forgets the tokens of a row but the first `count`.
    fn rewind(&self, row: usize, count: usize) -> PyResult<()> {
        self.check([&row])?;
        self.core().rewind(row, count);
        Ok(())
    }
}

impl Gpt2Rows {
    fn core(&self) -> MutexGuard<'_, Decoder> {
        self.core.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn check<'a>(&self, rows: impl IntoIterator<Item = &'a usize>) -> PyResult<()> {
        let count = self.core().len();
        if rows.into_iter().any(|&row| row >= count) {
            return Err(PyValueError::new_err("there are not so many rows"));
        }
        Ok(())
    }
}
