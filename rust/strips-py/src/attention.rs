//! Attention for training on CPUs.

use numpy::{IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use strips_decode::{Number, Rows};

/// A table of numbers: float32, or bfloat16 by its bits.
#[derive(FromPyObject)]
pub enum Table<'py> {
    /// As they are.
    Whole(PyReadonlyArray2<'py, f32>),
    /// The upper half of each.
    Half(PyReadonlyArray2<'py, u16>),
}

/// Causal self-attention within rows: of `parts` (tokens, 3 * width), query, key and value of each token, head after head in
/// each, what every token attends to, (tokens, width), and the logarithms of the softmaxes' denominators, (tokens, heads).
///
/// A row begins at each of `bounds` and ends at the next; tokens outside of all rows get zeros. Before its own tokens a row
/// has the first `borrowed` ones, as many as are given for it, of the last row before it that borrows none. Numbers are
/// float32, or bfloat16 as unsigned integers of 16 bits. The work is shared among `threads`.
#[pyfunction]
#[pyo3(signature = (parts, bounds, *, heads, scale, borrowed=None, threads=1))]
pub fn attend<'py>(
    py: Python<'py>,
    parts: Table<'py>,
    bounds: PyReadonlyArray1<'py, i64>,
    heads: usize,
    scale: f32,
    borrowed: Option<PyReadonlyArray1<'py, i64>>,
    threads: usize,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let layout = Layout { bounds, borrowed, heads, scale, threads };
    match parts {
        Table::Whole(parts) => forward(py, &parts, &layout),
        Table::Half(parts) => forward(py, &parts, &layout),
    }
}

/// The gradient of `attend`'s `parts`, in their shape and type: `grads` (tokens, width) is that of its first answer, in the
/// type of `parts`, and `normalisers` its second answer.
#[pyfunction]
#[pyo3(signature = (parts, grads, normalisers, bounds, *, heads, scale, borrowed=None, threads=1))]
#[expect(clippy::too_many_arguments, reason = "keywords tell them apart")]
pub fn attend_back<'py>(
    py: Python<'py>,
    parts: Table<'py>,
    grads: Table<'py>,
    normalisers: PyReadonlyArray2<'py, f32>,
    bounds: PyReadonlyArray1<'py, i64>,
    heads: usize,
    scale: f32,
    borrowed: Option<PyReadonlyArray1<'py, i64>>,
    threads: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let layout = Layout { bounds, borrowed, heads, scale, threads };
    match (parts, grads) {
        (Table::Whole(parts), Table::Whole(grads)) => backward(py, &parts, &grads, &normalisers, &layout),
        (Table::Half(parts), Table::Half(grads)) => backward(py, &parts, &grads, &normalisers, &layout),
        _ => Err(PyValueError::new_err("`parts` and `grads` are of one type")),
    }
}

/// Which tokens attend to each other, as the caller gives it.
struct Layout<'py> {
    bounds: PyReadonlyArray1<'py, i64>,
    borrowed: Option<PyReadonlyArray1<'py, i64>>,
    heads: usize,
    scale: f32,
    threads: usize,
}

impl Layout<'_> {
    /// `bounds` and `borrowed`, if they fit each other and so many tokens.
    fn checked(&self, tokens: usize) -> PyResult<(Vec<usize>, Vec<usize>)> {
        let bounds = counts(&self.bounds)
            .filter(|bounds| bounds.is_sorted() && bounds.last().is_some_and(|&last| last <= tokens))
            .ok_or_else(|| PyValueError::new_err("`bounds` ascend, and end within the tokens"))?;
        let borrowed = self.borrowed.as_ref().map_or(Some(Vec::new()), counts);
        let borrowed = borrowed
            .filter(|borrowed| lends_enough(&bounds, borrowed))
            .ok_or_else(|| PyValueError::new_err("`borrowed` has a count for each row, within the row that lends"))?;
        Ok((bounds, borrowed))
    }
}

/// Whether each row borrows no more than the last one before it that borrows none has.
fn lends_enough(bounds: &[usize], borrowed: &[usize]) -> bool {
    let mut most = 0;
    let within = bounds.windows(2).zip(borrowed).all(|(row, &count)| {
        if count == 0 {
            most = row[1] - row[0];
        }
        count <= most
    });
    within && (borrowed.is_empty() || borrowed.len() + 1 == bounds.len())
}

fn counts(numbers: &PyReadonlyArray1<'_, i64>) -> Option<Vec<usize>> {
    numbers.as_array().iter().map(|&number| usize::try_from(number).ok()).collect()
}

fn forward<'py, N: Number + numpy::Element>(
    py: Python<'py>,
    parts: &PyReadonlyArray2<'py, N>,
    layout: &Layout<'py>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let Layout { heads, scale, threads, .. } = *layout;
    let (tokens, width) = sizes(parts, heads)?;
    let (bounds, borrowed) = layout.checked(tokens)?;
    let rows = Rows { bounds: &bounds, borrowed: &borrowed, heads, size: width / heads, scale };
    let (mut mixed, mut normalisers) = (vec![N::default(); tokens * width], vec![0.0_f32; tokens * heads]);
    let parts = contiguous(parts)?;
    py.detach(|| strips_decode::attend(rows, parts, &mut mixed, &mut normalisers, threads));
    Ok((table(py, mixed, tokens, width)?, table(py, normalisers, tokens, heads)?))
}

fn backward<'py, N: Number + numpy::Element>(
    py: Python<'py>,
    parts: &PyReadonlyArray2<'py, N>,
    grads: &PyReadonlyArray2<'py, N>,
    normalisers: &PyReadonlyArray2<'py, f32>,
    layout: &Layout<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let Layout { heads, scale, threads, .. } = *layout;
    let (tokens, width) = sizes(parts, heads)?;
    let (bounds, borrowed) = layout.checked(tokens)?;
    if grads.as_array().dim() != (tokens, width) || normalisers.as_array().dim() != (tokens, heads) {
        return Err(PyValueError::new_err("the shapes of `grads` and `normalisers` do not fit those of `parts`"));
    }
    let rows = Rows { bounds: &bounds, borrowed: &borrowed, heads, size: width / heads, scale };
    let mut slopes = vec![N::default(); tokens * 3 * width];
    let (parts, grads, normalisers) = (contiguous(parts)?, contiguous(grads)?, contiguous(normalisers)?);
    py.detach(|| strips_decode::attend_back(rows, parts, grads, normalisers, &mut slopes, threads));
    table(py, slopes, tokens, 3 * width)
}

/// Tokens, and the width of a token's query.
fn sizes<N: numpy::Element>(parts: &PyReadonlyArray2<'_, N>, heads: usize) -> PyResult<(usize, usize)> {
    let (tokens, numbers) = parts.as_array().dim();
    if heads == 0 || numbers == 0 || !numbers.is_multiple_of(3 * heads) {
        return Err(PyValueError::new_err("a token's query, key and value are as wide, and have whole heads"));
    }
    Ok((tokens, numbers / 3))
}

fn contiguous<'a, N: numpy::Element, D: numpy::ndarray::Dimension>(
    array: &'a numpy::PyReadonlyArray<'_, N, D>,
) -> PyResult<&'a [N]> {
    array.as_slice().map_err(|_| PyValueError::new_err("an array is not contiguous"))
}

fn table<N: numpy::Element>(
    py: Python<'_>,
    numbers: Vec<N>,
    rows: usize,
    columns: usize,
) -> PyResult<Bound<'_, PyAny>> {
    let flat: Bound<'_, PyArray1<N>> = numbers.into_pyarray(py);
    Ok(flat.reshape([rows, columns])?.into_any())
}
