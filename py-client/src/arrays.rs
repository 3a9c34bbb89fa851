//! Arrays of environments, in one pass each: observations out of their parts, commands out of actions.

use numpy::ndarray::{ArrayView2, Axis};
use numpy::{
    Element, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2,
};
use pyo3::prelude::*;

use crate::errors::raise;

/// A real number of an observation.
trait Number: Element + Copy + PartialOrd {
    fn from_f64(x: f64) -> Self;
    fn within(self, low: Self, high: Self) -> Self;
    fn is_nan(self) -> bool;
}

macro_rules! number {
    ($($real:ty)*) => {
        $(impl Number for $real {
            fn from_f64(x: f64) -> $real {
                x as $real
            }
            fn within(self, low: $real, high: $real) -> $real {
                self.clamp(low, high)
            }
            fn is_nan(self) -> bool {
                <$real>::is_nan(self)
            }
        })*
    };
}

number!(f32 f64);

/// Write parts, each `(worlds,)` or `(worlds, columns)`, side by side into `out`, `(worlds, size)`, of `f32` or `f64`; numbers below
/// `low` or above `high`, one per column, count as these. NaN stays NaN. Returns whether there is any.
#[pyfunction]
pub(crate) fn pack(
    py: Python<'_>,
    out: &Bound<'_, PyAny>,
    parts: Vec<Bound<'_, PyAny>>,
    low: PyReadonlyArray1<'_, f32>,
    high: PyReadonlyArray1<'_, f32>,
) -> PyResult<bool> {
    let bounds = (low.as_slice()?, high.as_slice()?);
    match out.extract::<PyReadwriteArray2<'_, f64>>() {
        Ok(out) => pack_into(py, out, &parts, bounds),
        Err(_) => pack_into(
            py,
            out.extract::<PyReadwriteArray2<'_, f32>>()?,
            &parts,
            bounds,
        ),
    }
}

fn pack_into<O: Number>(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, O>,
    parts: &[Bound<'_, PyAny>],
    (low, high): (&[f32], &[f32]),
) -> PyResult<bool> {
    let size = low.len();
    let rows = out.as_array().nrows();
    let within = high.len() == size && low.iter().zip(high).all(|(low, high)| low <= high);
    if out.as_array().ncols() != size || !within {
        let problem = format!("pack: out or the bounds do not fit {size} columns");
        return Err(raise(py, "ArgumentError", problem));
    }
    let out = out.as_slice_mut()?;
    let mut first = 0;
    for part in parts {
        let columns = None
            .or_else(|| {
                place(part, (&mut *out, rows), first, low, high, |x: f32| {
                    f64::from(x)
                })
            })
            .or_else(|| place(part, (&mut *out, rows), first, low, high, |x: f64| x))
            .or_else(|| {
                place(part, (&mut *out, rows), first, low, high, |x: i32| {
                    f64::from(x)
                })
            })
            .or_else(|| place(part, (&mut *out, rows), first, low, high, |x: i64| x as f64))
            .or_else(|| {
                place(part, (&mut *out, rows), first, low, high, |x: bool| {
                    f64::from(u8::from(x))
                })
            });
        let Some(columns) = columns else {
            let problem =
                format!("pack: the part at column {first} has a type or shape that does not fit");
            return Err(raise(py, "ArgumentError", problem));
        };
        first += columns;
    }
    if first != size {
        let problem = format!("pack: {first} columns for {size}");
        return Err(raise(py, "ArgumentError", problem));
    }
    // every number is looked at, which is faster than to stop at the first
    Ok(out.iter().fold(false, |has_nan, x| has_nan | x.is_nan()))
}

/// Copies a part into the columns from `first` on; how many it has, or `None` if its type or shape is another.
fn place<T: Element + Copy, O: Number>(
    part: &Bound<'_, PyAny>,
    (out, rows): (&mut [O], usize),
    first: usize,
    low: &[f32],
    high: &[f32],
    real: impl Fn(T) -> f64,
) -> Option<usize> {
    let array = part.cast::<PyArrayDyn<T>>().ok()?.try_readonly().ok()?;
    let view = array.as_array();
    let view = match view.ndim() {
        1 => view.insert_axis(Axis(1)),
        _ => view,
    };
    let view: ArrayView2<'_, T> = view.into_dimensionality().ok()?;
    let columns = first..first + view.ncols();
    let (low, high) = (low.get(columns.clone())?, high.get(columns.clone())?);
    if view.nrows() != rows || rows == 0 {
        return None;
    }
    let size = out.len() / rows;
    let rows = out
        .chunks_exact_mut(size)
        .map(|row| &mut row[columns.clone()]);
    let put = |x: T, k: usize| {
        O::from_f64(real(x)).within(
            O::from_f64(f64::from(low[k])),
            O::from_f64(f64::from(high[k])),
        )
    };
    let is_free =
        low.iter().all(|&x| x == f32::NEG_INFINITY) && high.iter().all(|&x| x == f32::INFINITY);
    if is_free {
        for (to, from) in rows.zip(view.rows()) {
            match from.as_slice() {
                Some(from) => {
                    for (to, x) in to.iter_mut().zip(from) {
                        *to = O::from_f64(real(*x));
                    }
                }
                None => {
                    for (to, x) in to.iter_mut().zip(from) {
                        *to = O::from_f64(real(*x));
                    }
                }
            }
        }
    } else if view.ncols() == 1 {
        for (to, from) in rows.zip(view.column(0)) {
            to[0] = put(*from, 0);
        }
    } else {
        for (to, from) in rows.zip(view.rows()) {
            match from.as_slice() {
                Some(from) => {
                    for (k, to) in to.iter_mut().enumerate() {
                        *to = put(from[k], k);
                    }
                }
                None => {
                    for (k, to) in to.iter_mut().enumerate() {
                        *to = put(from[k], k);
                    }
                }
            }
        }
    }
    Some(columns.len())
}

/// Commands from actions: column k of `out`, from `first` on, becomes `base + scale * action`, within `low` and `high`, one a
/// column of `action`. The base is `start`, one per column, or without it what stands there. NaN stays NaN. With `joint_q`, of
/// the shape of `action`, it is at most `lead` from there, too.
#[pyfunction]
#[pyo3(signature = (out, first, action, scale, start, low, high, joint_q, lead, /))]
#[allow(clippy::too_many_arguments)] // a call of Python's, with positions only
pub(crate) fn drive(
    py: Python<'_>,
    mut out: PyReadwriteArray2<'_, f32>,
    first: usize,
    action: PyReadonlyArray2<'_, f32>,
    scale: PyReadonlyArray1<'_, f32>,
    start: Option<PyReadonlyArray1<'_, f32>>,
    low: PyReadonlyArray1<'_, f32>,
    high: PyReadonlyArray1<'_, f32>,
    joint_q: Option<PyReadonlyArray2<'_, f32>>,
    lead: f32,
) -> PyResult<()> {
    let (scale, low, high) = (scale.as_slice()?, low.as_slice()?, high.as_slice()?);
    let start = start.as_ref().map(|start| start.as_slice()).transpose()?;
    let (mut out, action) = (out.as_array_mut(), action.as_array());
    let size = action.ncols();
    let joint_q = joint_q.as_ref().map(|joint_q| joint_q.as_array());
    let fits = first + size <= out.ncols()
        && action.nrows() == out.nrows()
        && joint_q.is_none_or(|joint_q| joint_q.dim() == action.dim());
    let one_each = [
        scale.len(),
        low.len(),
        high.len(),
        start.map_or(size, <[f32]>::len),
    ];
    let ordered = low.iter().zip(high).all(|(low, high)| low <= high);
    if !fits || one_each != [size; 4] || !ordered || lead.is_nan() || lead < 0.0 {
        let problem = format!("drive: shapes or bounds do not fit {size} columns from {first} on");
        return Err(raise(py, "ArgumentError", problem));
    }
    for (row, (mut to, from)) in out.rows_mut().into_iter().zip(action.rows()).enumerate() {
        for (k, number) in from.iter().enumerate() {
            let base = start.map_or(to[first + k], |start| start[k]);
            let mut target = base + scale[k] * number;
            if let Some(joint_q) = joint_q {
                // of a NaN they keep the target
                let place = joint_q[[row, k]];
                target = if target < place - lead {
                    place - lead
                } else {
                    target
                };
                target = if target > place + lead {
                    place + lead
                } else {
                    target
                };
            }
            to[first + k] = target.clamp(low[k], high[k]);
        }
    }
    Ok(())
}
