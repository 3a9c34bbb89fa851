//! The numbers of a glTF file: buffers, and the accessors that say what lies in them.

use std::path::{Component, Path};

use base64::Engine as _;
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Document, buffer};

use super::{Beside, FILE_MAX, bytes_of};
use crate::cache_files::digest;
use crate::files::percent_decoded;

/// The bytes of a file's buffers.
pub(super) struct Buffers {
    bytes: Vec<Vec<u8>>,
    /// Those of them that are files.
    pub beside: Vec<Beside>,
}

impl Buffers {
    /// Reads all buffers; `blob` is the binary part of the file itself.
    pub fn read(
        document: &Document,
        mut blob: Option<Vec<u8>>,
        folder: &Path,
    ) -> Result<Buffers, String> {
        let (mut buffers, mut beside) = (Vec::new(), Vec::new());
        let mut total = 0;
        for buffer in document.buffers() {
            let data = match buffer.source() {
                buffer::Source::Bin => blob
                    .take()
                    .ok_or("its binary part is missing; export it again")?,
                buffer::Source::Uri(uri) => external(uri, folder, &mut beside)?,
            };
            if data.len() < buffer.length() {
                let (declared, present) = (buffer.length(), data.len());
                return Err(format!(
                    "a buffer should have {declared} bytes and has {present}; copy or export it again"
                ));
            }
            total += data.len() as u64;
            if total > FILE_MAX {
                return Err(format!(
                    "its buffers exceed the limit of {} MiB; simplify the mesh",
                    FILE_MAX >> 20
                ));
            }
            buffers.push(data);
        }
        Ok(Buffers {
            bytes: buffers,
            beside,
        })
    }

    /// Positions.
    pub fn points(&self, accessor: &Accessor) -> Result<Vec<[f64; 3]>, String> {
        if accessor.data_type() != DataType::F32 {
            return Err(packed());
        }
        self.rows(accessor, Dimensions::Vec3, |bytes| {
            [0, 4, 8].map(|at| f64::from(f32_at(bytes, at)))
        })
    }

    /// Indices of vertices.
    pub fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, String> {
        let scalar = Dimensions::Scalar;
        match accessor.data_type() {
            DataType::U8 => self.rows(accessor, scalar, |bytes| u32::from(bytes[0])),
            DataType::U16 => self.rows(accessor, scalar, |bytes| {
                u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))
            }),
            DataType::U32 => self.rows(accessor, scalar, |bytes| {
                u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            }),
            _ => Err("its indices are no whole numbers; export it again".to_owned()),
        }
    }

    /// Rows of two to four numbers, texture coordinates or colours, whole numbers as shares of their largest; the last of
    /// the four is 1 where there are fewer.
    pub fn shares(&self, accessor: &Accessor) -> Result<Vec<[f32; 4]>, String> {
        let count = accessor.dimensions().multiplicity().min(4);
        let read = |part: &dyn Fn(usize) -> f32| {
            let mut row = [0.0, 0.0, 0.0, 1.0];
            (0..count).for_each(|at| row[at] = part(at));
            row
        };
        let shape = accessor.dimensions();
        match accessor.data_type() {
            DataType::F32 => self.rows(accessor, shape, |bytes| read(&|at| f32_at(bytes, 4 * at))),
            DataType::U8 => self.rows(accessor, shape, |bytes| {
                read(&|at| f32::from(bytes[at]) / 255.0)
            }),
            DataType::U16 => self.rows(accessor, shape, |bytes| {
                let number = |at: usize| u16::from_le_bytes([bytes[2 * at], bytes[2 * at + 1]]);
                read(&|at| f32::from(number(at)) / 65535.0)
            }),
            _ => Err(packed()),
        }
    }

    /// A part of the buffers.
    pub fn view(&self, view: &buffer::View) -> Option<&[u8]> {
        let data = self.bytes.get(view.buffer().index())?;
        data.get(view.offset()..)?.get(..view.length())
    }

    /// The rows of an accessor, each read from its bytes.
    fn rows<T>(
        &self,
        accessor: &Accessor,
        shape: Dimensions,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        if accessor.dimensions() != shape || accessor.sparse().is_some() {
            return Err(packed());
        }
        let short = || "its buffers are shorter than it tells; copy or export it again".to_owned();
        let view = accessor.view().ok_or_else(short)?;
        let width = accessor.size();
        let stride = view.stride().unwrap_or(width).max(width);
        let data = self.view(&view).ok_or_else(short)?;
        let count = accessor.count();
        let mut rows = Vec::new();
        for row in 0..count {
            // read one by one: a count that is too large ends here before it takes memory
            let start = row
                .checked_mul(stride)
                .and_then(|at| at.checked_add(accessor.offset()))
                .ok_or_else(short)?;
            let end = start.checked_add(width).ok_or_else(short)?;
            rows.push(read(data.get(start..end).ok_or_else(short)?));
        }
        Ok(rows)
    }
}

fn packed() -> String {
    "its positions or indices are packed or sparse; export it plainly".to_owned()
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// The bytes of a buffer that is not in the file itself.
fn external(uri: &str, folder: &Path, beside: &mut Vec<Beside>) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        return base64_of(data).map_err(|reason| format!("a buffer's {reason}; export it again"));
    }
    // glTF writes addresses, and many exporters plain names
    let decoded = percent_decoded(uri).filter(|_| !folder.join(uri).is_file());
    let uri = decoded.as_deref().unwrap_or(uri);
    let path = Path::new(uri);
    let inside = path
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if uri.contains(':') || !inside {
        return Err(format!(
            "its buffer `{uri}` is not a file beside it; export it as .glb"
        ));
    }
    let bytes = bytes_of(&folder.join(path), FILE_MAX)
        .map_err(|reason| format!("its buffer `{uri}`: {reason}"))?;
    beside.push(Beside {
        path: uri.to_owned(),
        digest: digest(&bytes),
    });
    Ok(bytes)
}

/// The bytes of a `data:` URI, what follows the colon.
pub(super) fn base64_of(data: &str) -> Result<Vec<u8>, String> {
    let (_, text) = data
        .split_once(";base64,")
        .ok_or("data: URI is not base64")?;
    base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(|error| format!("base64 is broken: {error}"))
}
