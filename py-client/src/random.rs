//! Random numbers of tasks, made as those of a reset are.

use numpy::ndarray::{Array1, ArrayView1, ArrayViewMut2};
use numpy::{
    Element, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadwriteArray2, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use sim_daemon::config::{Draw, Stream, TASK_STREAMS};

use crate::errors::raise;

/// Indices of a stream end here, where those of frames begin.
const COLUMNS_MAX: usize = 1 << 24;

/// Uniform numbers in [0, 1), the same for the same seed, episode, stream and column, whatever else is asked for.
///
/// Philox4x32-10 under the seed as key, at the counter (0, episode, 64 + stream, first + column). In float32 they are
/// rounded towards zero, so that they stay below 1.
///
/// Args:
///     seeds: Seed of each row, uint64, shape ``(n,)``.
///     episodes: Episode of each row, uint32, shape ``(n,)``.
///     stream: What the numbers are for, 0 to 31; those of different streams have nothing to do with each other.
///     columns: How many numbers each row gets, at most 2**24.
///     out: Where they go, float32 or float64, shape ``(n, columns)``, a part of another array if need be; a new
///         float64 array if left out.
///     firsts: Which number of the stream each row begins with, uint32, shape ``(n,)``; 0 if left out.
///
/// Returns:
///     ``out``, or the new array, shape ``(n, columns)``.
///
/// Raises:
///     ArgumentError: A shape or the stream is not as above. A wrong dtype is a TypeError.
#[pyfunction]
#[pyo3(signature = (seeds, episodes, stream, columns, out = None, firsts = None))]
pub(crate) fn draw<'py>(
    py: Python<'py>,
    seeds: PyReadonlyArray1<'py, u64>,
    episodes: PyReadonlyArray1<'py, u32>,
    stream: i64,
    columns: usize,
    out: Option<Bound<'py, PyAny>>,
    firsts: Option<PyReadonlyArray1<'py, u32>>,
) -> PyResult<Bound<'py, PyAny>> {
    let refused = |problem: String| Err(raise(py, "ArgumentError", problem));
    let rows = seeds.len();
    if episodes.len() != rows {
        let given = episodes.len();
        return refused(format!(
            "draw: episodes has shape ({given},) and seeds ({rows},); give one of each a row"
        ));
    }
    let Some(stream) = u8::try_from(stream).ok().filter(|&k| k < TASK_STREAMS) else {
        let last = TASK_STREAMS - 1;
        return refused(format!(
            "draw: stream is {stream}; give one from 0 to {last}"
        ));
    };
    let firsts = match &firsts {
        Some(firsts) if firsts.len() == rows => firsts.as_array().to_owned(),
        Some(firsts) => {
            let given = firsts.len();
            return refused(format!(
                "draw: firsts has shape ({given},) and seeds ({rows},); give one of each a row"
            ));
        }
        None => Array1::zeros(rows),
    };
    let last = firsts.iter().copied().max().unwrap_or(0) as usize;
    if columns.saturating_add(last) > COLUMNS_MAX {
        return refused(format!(
            "draw: columns is {columns}, from {last} on; a stream has {COLUMNS_MAX}"
        ));
    }
    let out = match out {
        Some(out) => out,
        None => PyArray2::<f64>::zeros(py, [rows, columns], false).into_any(),
    };
    let (seeds, episodes) = (seeds.as_array(), episodes.as_array());
    let of = Rows {
        seeds,
        episodes,
        firsts: firsts.view(),
        stream: Stream::Task(stream),
    };
    if let Ok(array) = out.cast::<PyArray2<f32>>() {
        let mut array = writable(array, rows, columns)?;
        let array = array.as_array_mut();
        py.detach(|| fill(of, array, below));
    } else if let Ok(array) = out.cast::<PyArray2<f64>>() {
        let mut array = writable(array, rows, columns)?;
        let array = array.as_array_mut();
        py.detach(|| fill(of, array, |unit| unit));
    } else {
        let problem = "draw: out is no float32 or float64 array of two axes";
        return Err(PyTypeError::new_err(problem));
    }
    Ok(out)
}

fn writable<'py, T: Element>(
    array: &Bound<'py, PyArray2<T>>,
    rows: usize,
    columns: usize,
) -> PyResult<PyReadwriteArray2<'py, T>> {
    let given = [array.shape()[0], array.shape()[1]];
    if given != [rows, columns] {
        let [n, m] = given;
        let problem = format!("draw: out has shape ({n}, {m}); expected ({rows}, {columns})");
        return Err(raise(array.py(), "ArgumentError", problem));
    }
    Ok(array.try_readwrite()?)
}

/// What the rows are drawn from.
struct Rows<'a> {
    seeds: ArrayView1<'a, u64>,
    episodes: ArrayView1<'a, u32>,
    firsts: ArrayView1<'a, u32>,
    stream: Stream,
}

fn fill<T>(of: Rows<'_>, mut out: ArrayViewMut2<'_, T>, rounded: impl Fn(f64) -> T) {
    for (k, mut row) in out.outer_iter_mut().enumerate() {
        let draw = Draw::new(of.seeds[k], 0, of.episodes[k], of.stream);
        for (index, entry) in (of.firsts[k]..).zip(row.iter_mut()) {
            *entry = rounded(draw.uniform(index, 0.0, 1.0));
        }
    }
}

/// The next number of single precision towards zero. Those in [0, 1) that are multiples of 2⁻⁵³ lose 29 bits.
fn below(unit: f64) -> f32 {
    f64::from_bits(unit.to_bits() & !((1 << 29) - 1)) as f32
}
