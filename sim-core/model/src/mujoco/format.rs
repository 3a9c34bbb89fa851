//! The file of a compiled model: arrays of `mjModel` by their names, as safetensors.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensors};

use crate::error::ModelError;
use crate::files::{self, FileError};

/// Version of the file; `py-client/python/tightloop/mujoco/export.py` writes it.
const FORMAT: i64 = 1;
/// Largest file [bytes].
const FILE_MAX: u64 = 1 << 31;

/// Entries of an array, flat.
enum Entries {
    Reals(Vec<f64>),
    Integers(Vec<i64>),
}

/// The entries of a tensor, from their bytes.
fn numbers<T, const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> T) -> Vec<T> {
    data.as_chunks::<N>()
        .0
        .iter()
        .map(|bytes| number(*bytes))
        .collect()
}

/// A compiled model.
pub(super) struct ModelFile {
    path: PathBuf,
    arrays: HashMap<String, (Vec<usize>, Entries)>,
}

impl ModelFile {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that is missing, or is no exported model, or of another version.
    pub fn read(path: &Path) -> Result<ModelFile, ModelError> {
        let fault = |reason: String| ModelError::MujocoFile {
            path: path.to_owned(),
            reason,
        };
        let bytes = files::read(path, FILE_MAX).map_err(|error| match error {
            FileError::TooLarge { .. } => fault("is larger than 2 GiB".to_owned()),
            error => error.at_path(path),
        })?;
        let tensors = SafeTensors::deserialize(&bytes)
            .map_err(|error| fault(format!("is no exported MuJoCo model: {error}")))?;
        let mut arrays = HashMap::new();
        for (name, tensor) in tensors.iter() {
            let data = tensor.data();
            let entries = match tensor.dtype() {
                Dtype::F64 => Entries::Reals(numbers(data, f64::from_le_bytes)),
                Dtype::I32 => {
                    Entries::Integers(numbers(data, |x| i64::from(i32::from_le_bytes(x))))
                }
                Dtype::U8 => Entries::Integers(numbers(data, |[x]| i64::from(x))),
                other => return Err(fault(format!("array `{name}` has the type {other:?}"))),
            };
            if tensor.shape().is_empty() {
                return Err(fault(format!("array `{name}` is a single number")));
            }
            if let Entries::Reals(all) = &entries
                && all.iter().any(|x| x.is_nan())
            {
                return Err(fault(format!("array `{name}` has a NaN")));
            }
            arrays.insert(name.to_owned(), (tensor.shape().to_vec(), entries));
        }
        let model = ModelFile {
            path: path.to_owned(),
            arrays,
        };
        match model.integers("format", 1)?[..] {
            [FORMAT] => Ok(model),
            [other] => Err(model.fault(format!(
                "has format {other}, this version reads {FORMAT}; save the scene again"
            ))),
            _ => Err(model.fault("has no format".to_owned())),
        }
    }

    /// An error about this file.
    pub fn fault(&self, reason: String) -> ModelError {
        ModelError::MujocoFile {
            path: self.path.clone(),
            reason,
        }
    }

    /// How many rows an array has.
    pub fn rows(&self, name: &str) -> usize {
        let shape = self.arrays.get(name).map(|(shape, _)| shape);
        shape.and_then(|shape| shape.first().copied()).unwrap_or(0)
    }

    /// Entries per row of an array.
    pub fn columns(&self, name: &str) -> usize {
        let shape = self.arrays.get(name).map(|(shape, _)| shape);
        shape.and_then(|shape| shape.get(1).copied()).unwrap_or(0)
    }

    fn entries(&self, name: &str, count: usize) -> Result<&Entries, ModelError> {
        let Some((shape, entries)) = self.arrays.get(name) else {
            return Err(self.fault(format!("lacks the array `{name}`; save the scene again")));
        };
        let size: usize = shape.iter().product();
        if size != count {
            return Err(self.fault(format!(
                "array `{name}` has {size} entries instead of {count}"
            )));
        }
        Ok(entries)
    }

    /// An array of integers.
    pub fn integers(&self, name: &str, count: usize) -> Result<Vec<i64>, ModelError> {
        match self.entries(name, count)? {
            Entries::Integers(all) => Ok(all.clone()),
            Entries::Reals(_) => Err(self.fault(format!("array `{name}` is not of integers"))),
        }
    }

    /// An array of indices below `end`; what is negative stands for none.
    pub fn indices(
        &self,
        name: &str,
        count: usize,
        end: usize,
    ) -> Result<Vec<Option<usize>>, ModelError> {
        let all = self.integers(name, count)?;
        if let Some(bad) = all.iter().find(|&&x| x >= end as i64) {
            return Err(self.fault(format!("array `{name}` has the index {bad} beyond {end}")));
        }
        Ok(all.into_iter().map(|x| usize::try_from(x).ok()).collect())
    }

    /// An array of numbers.
    pub fn reals(&self, name: &str, count: usize) -> Result<Vec<f64>, ModelError> {
        match self.entries(name, count)? {
            Entries::Reals(all) => Ok(all.clone()),
            Entries::Integers(_) => Err(self.fault(format!("array `{name}` is not of numbers"))),
        }
    }

    /// An array of rows.
    pub fn vectors<const N: usize>(
        &self,
        name: &str,
        count: usize,
    ) -> Result<Vec<[f64; N]>, ModelError> {
        let all = self.reals(name, count * N)?;
        Ok(all.as_chunks::<N>().0.to_vec())
    }

    /// How stiffness or damping grows, two numbers per row. All are 0 where MuJoCo has no such array, or where `is_off` says that
    /// an option switches it off.
    pub fn curves(
        &self,
        name: &str,
        count: usize,
        is_off: bool,
    ) -> Result<Vec<[f64; 2]>, ModelError> {
        match self.has(name) && !is_off {
            true => self.vectors(name, count),
            false => Ok(vec![[0.0; 2]; count]),
        }
    }

    /// The first columns of an array whose rows differ in length between versions of MuJoCo.
    pub fn first_columns<const N: usize>(
        &self,
        name: &str,
        count: usize,
    ) -> Result<Vec<[f64; N]>, ModelError> {
        let width = self.arrays.get(name).and_then(|(shape, _)| shape.get(1));
        let width = width.copied().unwrap_or(0);
        if width < N {
            let fault = format!("array `{name}` has {width} columns, fewer than {N}");
            return Err(self.fault(fault));
        }
        let all = self.reals(name, count * width)?;
        let rows = all.chunks_exact(width);
        Ok(rows.filter_map(|row| row.first_chunk().copied()).collect())
    }

    /// An array of rows of integers.
    pub fn vectors_of_integers<const N: usize>(
        &self,
        name: &str,
        count: usize,
    ) -> Result<Vec<[i64; N]>, ModelError> {
        let all = self.integers(name, count * N)?;
        Ok(all.as_chunks::<N>().0.to_vec())
    }

    /// An array of integers; all are `other` where this version of MuJoCo has no such array.
    pub fn integers_or(
        &self,
        name: &str,
        count: usize,
        other: i64,
    ) -> Result<Vec<i64>, ModelError> {
        match self.arrays.contains_key(name) {
            true => self.integers(name, count),
            false => Ok(vec![other; count]),
        }
    }

    /// An array of numbers; all are `other` where this version of MuJoCo has no such array.
    pub fn reals_or(&self, name: &str, count: usize, other: f64) -> Result<Vec<f64>, ModelError> {
        match self.has(name) {
            true => self.reals(name, count),
            false => Ok(vec![other; count]),
        }
    }

    /// One number.
    pub fn real(&self, name: &str) -> Result<f64, ModelError> {
        Ok(self.reals(name, 1)?[0])
    }

    /// One number; `other` where files of older versions lack it.
    pub fn real_or(&self, name: &str, other: f64) -> Result<f64, ModelError> {
        match self.arrays.contains_key(name) {
            true => self.real(name),
            false => Ok(other),
        }
    }

    /// One integer.
    pub fn integer(&self, name: &str) -> Result<i64, ModelError> {
        Ok(self.integers(name, 1)?[0])
    }

    /// Whether it has an array.
    pub fn has(&self, name: &str) -> bool {
        self.arrays.contains_key(name)
    }

    /// The first row of an array of which any entry differs from 0; none where this version of MuJoCo has no such array.
    pub fn first_set(&self, name: &str) -> Option<usize> {
        let (shape, entries) = self.arrays.get(name)?;
        let width = shape.iter().skip(1).product::<usize>().max(1);
        let place = match entries {
            Entries::Reals(all) => all.iter().position(|&x| x != 0.0),
            Entries::Integers(all) => all.iter().position(|&x| x != 0),
        };
        place.map(|place| place / width)
    }

    /// Strings that end with a 0.
    pub fn texts(&self, name: &str) -> Result<Vec<String>, ModelError> {
        let bytes = self.integers(name, self.rows(name))?;
        let bytes: Vec<u8> = bytes.into_iter().map(|byte| byte as u8).collect();
        let mut texts: Vec<String> = bytes
            .split(|&byte| byte == 0)
            .map(|text| String::from_utf8_lossy(text).into_owned())
            .collect();
        texts.pop();
        Ok(texts)
    }

    /// Whether a version of MuJoCo, major and minor, or a newer one compiled the model.
    pub fn is_since(&self, version: [u32; 2]) -> Result<bool, ModelError> {
        if !self.has("mujoco_version") {
            return Ok(false);
        }
        let text = self.texts("mujoco_version")?.concat();
        let mut parts = text.split('.').map(|part| part.parse().unwrap_or(0));
        let file_version: [u32; 2] = std::array::from_fn(|_| parts.next().unwrap_or(0));
        Ok(file_version >= version)
    }

    /// An array of enumerators, by the names that MuJoCo gives them.
    pub fn kinds(&self, name: &str, count: usize) -> Result<Vec<String>, ModelError> {
        let known = self.texts(&format!("{name}.names"))?;
        let kinds = self.integers(name, count)?.into_iter().map(|kind| {
            let place = usize::try_from(kind).ok();
            let known_kind = place.and_then(|place| known.get(place));
            known_kind
                .cloned()
                .ok_or_else(|| self.fault(format!("array `{name}` has the unknown kind {kind}")))
        });
        kinds.collect()
    }
}
