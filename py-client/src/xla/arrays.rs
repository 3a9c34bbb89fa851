//! Arrays of NumPy as the arrays of a program, and the other way round.

use bytemuck::{AnyBitPattern, NoUninit, Pod, cast_slice, cast_slice_mut};
use numpy::{
    Element, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use sim_protocol::Dtype;

use super::abi::{Kind, Operand, Output};

macro_rules! kinds {
    ($($name:ident: $entry:ty = $kind:expr),*) => {
        /// An array to be read, borrowed.
        pub(super) enum Array<'py> {
            $($name(PyReadonlyArrayDyn<'py, $entry>)),*
        }

        /// Borrows an array of a type that programs have.
        pub(super) fn borrowed<'py>(value: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
            $(if let Ok(array) = value.cast::<PyArrayDyn<$entry>>() {
                return Ok(Array::$name(array.try_readonly()?));
            })*
            Err(unknown(value))
        }

        impl Array<'_> {
            pub(super) fn operand(&self) -> PyResult<Operand<'_>> {
                match self {
                    $(Array::$name(array) => operand(array, $kind)),*
                }
            }
        }
    };
}

kinds!(
    F32: f32 = Kind::Number(Dtype::F32),
    F64: f64 = Kind::Number(Dtype::F64),
    U32: u32 = Kind::Number(Dtype::U32),
    I32: i32 = Kind::Number(Dtype::I32),
    U64: u64 = Kind::Number(Dtype::U64),
    Bool: bool = Kind::Bool
);

/// An array to be written, borrowed. One of bool comes as its bytes, which are 0 and 1.
pub(super) enum ArrayMut<'py> {
    Bool(PyReadwriteArrayDyn<'py, u8>),
    F32(PyReadwriteArrayDyn<'py, f32>),
    F64(PyReadwriteArrayDyn<'py, f64>),
    U32(PyReadwriteArrayDyn<'py, u32>),
    I32(PyReadwriteArrayDyn<'py, i32>),
    U64(PyReadwriteArrayDyn<'py, u64>),
}

fn operand<'a, T: Element + NoUninit>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
    kind: Kind,
) -> PyResult<Operand<'a>> {
    Ok(Operand {
        kind,
        shape: array.shape().to_vec(),
        bytes: cast_slice(array.as_slice()?),
    })
}

fn output<'a, T: Element + Pod>(
    array: &'a mut PyReadwriteArrayDyn<'_, T>,
    kind: Kind,
) -> PyResult<Output<'a>> {
    Ok(Output {
        kind,
        shape: array.shape().to_vec(),
        bytes: cast_slice_mut(array.as_slice_mut()?),
    })
}

pub(super) fn borrowed_mut<'py>(value: &Bound<'py, PyAny>) -> PyResult<ArrayMut<'py>> {
    fn written<'py, T: Element>(value: &Bound<'py, PyAny>) -> Option<PyReadwriteArrayDyn<'py, T>> {
        value.cast::<PyArrayDyn<T>>().ok()?.try_readwrite().ok()
    }
    None.or_else(|| written(value).map(ArrayMut::F32))
        .or_else(|| written(value).map(ArrayMut::F64))
        .or_else(|| written(value).map(ArrayMut::U32))
        .or_else(|| written(value).map(ArrayMut::I32))
        .or_else(|| written(value).map(ArrayMut::U64))
        .or_else(|| written(value).map(ArrayMut::Bool))
        .ok_or_else(|| unknown(value))
}

impl ArrayMut<'_> {
    pub(super) fn output(&mut self) -> PyResult<Output<'_>> {
        match self {
            ArrayMut::Bool(array) => output(array, Kind::Bool),
            ArrayMut::F32(array) => output(array, Kind::Number(Dtype::F32)),
            ArrayMut::F64(array) => output(array, Kind::Number(Dtype::F64)),
            ArrayMut::U32(array) => output(array, Kind::Number(Dtype::U32)),
            ArrayMut::I32(array) => output(array, Kind::Number(Dtype::I32)),
            ArrayMut::U64(array) => output(array, Kind::Number(Dtype::U64)),
        }
    }
}

/// A copy of an operand, whose memory is the program's.
pub(super) fn to_numpy<'py>(py: Python<'py>, from: &Operand<'_>) -> PyResult<Bound<'py, PyAny>> {
    match from.kind {
        Kind::Bool => {
            let entries = from.bytes.iter().map(|&byte| byte != 0);
            let flat = PyArray1::from_iter(py, entries);
            Ok(flat.reshape(from.shape.clone())?.into_any())
        }
        Kind::Number(Dtype::F64) => copied::<f64>(py, from),
        Kind::Number(Dtype::U32) => copied::<u32>(py, from),
        Kind::Number(Dtype::I32) => copied::<i32>(py, from),
        Kind::Number(Dtype::F32) => copied::<f32>(py, from),
        other => Err(PyTypeError::new_err(format!("an operand is {other:?}"))),
    }
}

fn copied<'py, T: Element + AnyBitPattern>(
    py: Python<'py>,
    from: &Operand<'_>,
) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray1::from_slice(py, cast_slice::<u8, T>(from.bytes));
    Ok(flat.reshape(from.shape.clone())?.into_any())
}

fn unknown(value: &Bound<'_, PyAny>) -> PyErr {
    let kind = value
        .getattr("dtype")
        .unwrap_or_else(|_| value.get_type().into_any());
    PyTypeError::new_err(format!(
        "no program has arrays of {kind}, or it cannot be written"
    ))
}
