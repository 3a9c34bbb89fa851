//! Constants of an ONNX file, in single precision.

use std::cell::Cell;

use half::f16;

use super::protobuf::{Value, entry, fields};
use crate::PolicyError;
use crate::network::SIZE_MAX;

/// Reads a file beside the ONNX file, by its name: from a byte on, that many bytes.
pub type ReadExternal<'a> = &'a dyn Fn(&str, u64, u64) -> Result<Vec<u8>, String>;

/// Types of numbers, as `TensorProto.DataType` has them.
const FLOAT: i64 = 1;
const INT32: i64 = 6;
const INT64: i64 = 7;
const BOOL: i64 = 9;
const FLOAT16: i64 = 10;
const DOUBLE: i64 = 11;

/// A constant. Whole numbers are exact up to 2²⁴, and no shape of a policy has more.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Tensor {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<f32>,
}

impl Tensor {
    pub(super) fn scalar(value: f32) -> Tensor {
        Tensor {
            shape: Vec::new(),
            values: vec![value],
        }
    }

    pub(super) fn row(values: Vec<f32>) -> Tensor {
        Tensor {
            shape: vec![values.len()],
            values,
        }
    }

    /// The only value, if there is one alone.
    pub(super) fn single(&self) -> Option<f32> {
        match self.values[..] {
            [value] => Some(value),
            _ => None,
        }
    }

    /// Rows and columns of a matrix.
    pub(super) fn matrix(&self) -> Option<(usize, usize)> {
        match self.shape[..] {
            [rows, columns] => Some((rows, columns)),
            _ => None,
        }
    }

    /// The values if they are a row: no axis but the last one has more than one entry.
    pub(super) fn as_row(&self) -> Option<&[f32]> {
        let (_, before) = self.shape.split_last()?;
        before.iter().all(|&n| n == 1).then_some(&self.values)
    }

    /// Joins values of two constants, of which one may be single, or have the same shape.
    pub(super) fn joined(&self, other: &Tensor, join: impl Fn(f32, f32) -> f32) -> Option<Tensor> {
        let (shape, values) = match (self.single(), other.single()) {
            _ if self.shape == other.shape => {
                let pairs = self.values.iter().zip(&other.values);
                (&self.shape, pairs.map(|(&a, &b)| join(a, b)).collect())
            }
            (_, Some(b)) if other.shape.len() <= self.shape.len() => (
                &self.shape,
                self.values.iter().map(|&a| join(a, b)).collect(),
            ),
            (Some(a), _) if self.shape.len() <= other.shape.len() => (
                &other.shape,
                other.values.iter().map(|&b| join(a, b)).collect(),
            ),
            _ => {
                let (a, b) = (self.as_row()?, other.as_row()?);
                let longest = match self.shape.len() >= other.shape.len() {
                    true => &self.shape,
                    false => &other.shape,
                };
                let fits = a.len() == b.len();
                let pairs = a.iter().zip(b);
                (
                    fits.then_some(longest)?,
                    pairs.map(|(&a, &b)| join(a, b)).collect(),
                )
            }
        };
        Some(Tensor {
            shape: shape.clone(),
            values,
        })
    }

    /// The matrix with rows and columns exchanged.
    pub(super) fn transposed(&self) -> Option<Tensor> {
        let (rows, columns) = self.matrix()?;
        let values =
            (0..columns).flat_map(|c| (0..rows).map(move |r| self.values[r * columns + c]));
        Some(Tensor {
            shape: vec![columns, rows],
            values: values.collect(),
        })
    }

    /// Name and value of a `TensorProto`.
    pub(super) fn parse(
        bytes: &[u8],
        external: ReadExternal<'_>,
    ) -> Result<(String, Tensor), PolicyError> {
        let mut parts = Parts::default();
        fields(bytes, |number, value| parts.take(number, value))?;
        let name = std::mem::take(&mut parts.name);
        match parts.tensor(external) {
            Ok(tensor) => Ok((name, tensor)),
            Err(problem) => Err(PolicyError::Tensor {
                tensor: name,
                problem,
            }),
        }
    }
}

/// A `TensorProto`.
#[derive(Default)]
struct Parts<'a> {
    name: String,
    axes: Vec<i64>,
    dtype: i64,
    raw: Option<&'a [u8]>,
    floats: Vec<f32>,
    integers: Vec<i64>,
    is_external: bool,
    external: Vec<(String, String)>,
}

impl<'a> Parts<'a> {
    fn take(&mut self, number: u64, value: Value<'a>) -> Result<(), PolicyError> {
        match number {
            1 => value.integers(&mut self.axes)?,
            2 => self.dtype = value.integer()?,
            4 => value.floats(&mut self.floats)?,
            5 | 7 => value.integers(&mut self.integers)?,
            8 => self.name = value.text()?.to_owned(),
            9 => self.raw = Some(value.bytes()?),
            10 => value.doubles(&mut self.floats)?,
            13 => self.external.push(entry(value.bytes()?)?),
            14 => self.is_external = value.integer()? == 1,
            _ => {}
        }
        Ok(())
    }

    fn tensor(self, external: ReadExternal<'_>) -> Result<Tensor, String> {
        let shape: Option<Vec<usize>> =
            self.axes.iter().map(|&n| usize::try_from(n).ok()).collect();
        let count = shape
            .as_ref()
            .and_then(|shape| shape.iter().try_fold(1usize, |all, &n| all.checked_mul(n)));
        let fits = |shape: &Vec<usize>| shape.iter().all(|axis| (1..=SIZE_MAX).contains(axis));
        let (Some(shape), Some(count)) = (shape.filter(fits), count) else {
            return Err(format!(
                "has the shape {:?}, and axes have 1 to {SIZE_MAX} entries; export the policy anew",
                self.axes
            ));
        };
        let values = match (self.is_external, self.raw) {
            (true, _) => decoded(self.dtype, &self.read(&shape, count, external)?)?,
            (false, Some(raw)) => decoded(self.dtype, raw)?,
            (false, None) => match self.dtype {
                FLOAT | DOUBLE => self.floats,
                INT32 | INT64 | BOOL => self.integers.iter().map(|&n| n as f32).collect(),
                // their bits, as ONNX has them
                FLOAT16 => self
                    .integers
                    .iter()
                    .map(|&n| half(n))
                    .collect::<Result<_, _>>()?,
                other => return Err(unknown(other)),
            },
        };
        if values.len() != count {
            return Err(format!(
                "has the shape {shape:?}, which is {count} numbers, and {} of them; export the policy anew",
                values.len()
            ));
        }
        Ok(Tensor { shape, values })
    }

    /// The bytes of weights in a file of their own.
    fn read(
        &self,
        shape: &[usize],
        count: usize,
        external: ReadExternal<'_>,
    ) -> Result<Vec<u8>, String> {
        let text = |name: &str| {
            let named = self.external.iter().find(|(known, _)| known == name);
            named.map(|(_, text)| text.as_str())
        };
        let number = |name: &str| {
            let parsed = text(name).map(str::parse::<u64>).transpose();
            parsed.map_err(|_| format!("has the {name} {:?} in its file", text(name)))
        };
        let file = text("location").ok_or("lies in another file, which it does not name")?;
        let is_beside = !file.is_empty()
            && !file
                .split(['/', '\\'])
                .any(|part| part == ".." || part.contains(':'))
            && !file.starts_with(['/', '\\']);
        if !is_beside {
            return Err(format!(
                "lies in `{file}`, which is not in the folder of the ONNX file; put it there"
            ));
        }
        let bytes = (count as u64).saturating_mul(bytes_of(self.dtype)?);
        match number("length")? {
            Some(length) if length != bytes => Err(format!(
                "has the shape {shape:?}, which is {bytes} bytes, and {length} in `{file}`; export the policy anew"
            )),
            _ => external(file, number("offset")?.unwrap_or(0), bytes),
        }
    }
}

/// Numbers of raw bytes.
fn decoded(dtype: i64, bytes: &[u8]) -> Result<Vec<f32>, String> {
    fn all<const BYTES: usize>(
        bytes: &[u8],
        number: impl Fn([u8; BYTES]) -> f32,
    ) -> Result<Vec<f32>, String> {
        let (numbers, rest) = bytes.as_chunks::<BYTES>();
        match rest.is_empty() {
            true => Ok(numbers.iter().map(|&bytes| number(bytes)).collect()),
            false => Err("ends within a number; export the policy anew".to_owned()),
        }
    }
    match dtype {
        FLOAT => all(bytes, f32::from_le_bytes),
        DOUBLE => all(bytes, |bytes| f64::from_le_bytes(bytes) as f32),
        INT32 => all(bytes, |bytes| i32::from_le_bytes(bytes) as f32),
        INT64 => all(bytes, |bytes| i64::from_le_bytes(bytes) as f32),
        BOOL => all(bytes, |[byte]| f32::from(byte)),
        FLOAT16 => all(bytes, |bytes| f16::from_le_bytes(bytes).to_f32()),
        other => Err(unknown(other)),
    }
}

/// A number of half precision, of its bits.
fn half(bits: i64) -> Result<f32, String> {
    let bits = u16::try_from(bits)
        .map_err(|_| format!("has {bits} as the bits of a float16; export the policy anew"))?;
    Ok(f16::from_bits(bits).to_f32())
}

/// Bytes of a number.
fn bytes_of(dtype: i64) -> Result<u64, String> {
    match dtype {
        FLOAT | INT32 => Ok(4),
        DOUBLE | INT64 => Ok(8),
        FLOAT16 => Ok(2),
        BOOL => Ok(1),
        other => Err(unknown(other)),
    }
}

/// `external`, for at most `limit` bytes altogether.
pub(super) fn within(
    external: ReadExternal<'_>,
    limit: u64,
) -> impl Fn(&str, u64, u64) -> Result<Vec<u8>, String> {
    let left = Cell::new(limit);
    move |file, offset, length| {
        let rest = left.get().checked_sub(length).ok_or_else(|| {
            format!("lies in `{file}`, and weights beside the ONNX file have more than {limit} bytes; give a smaller policy")
        })?;
        left.set(rest);
        external(file, offset, length)
    }
}

fn unknown(dtype: i64) -> String {
    let name = match dtype {
        16 => "bfloat16".to_owned(),
        other => format!("the type {other} of ONNX"),
    };
    format!("has {name}; export the policy in float32")
}
