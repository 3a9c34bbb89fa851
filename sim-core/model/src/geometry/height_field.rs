//! Height fields: a grid of elevations over a rectangle, and what is solid below.

use std::path::{Path, PathBuf};

use super::load::FILE_MAX;
use super::trimesh::TriMesh;
use crate::error::ModelError;
use crate::files;

/// Most samples of the height fields of a scene: whole numbers up to there have a place in `f32`.
pub const SAMPLES_MAX: usize = 1 << 24;

/// A grid of elevations over x and y of its frame, centred, in rows along x.
///
/// The solid below it consists of a prism under each of two triangles per cell, as in MuJoCo. Their common edge goes from a
/// cell's lowest corner along x and y to its highest.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// Samples along y.
    pub rows: usize,
    /// Samples along x.
    pub columns: usize,
    /// Half the lengths along x and y [m].
    pub half: [f64; 2],
    /// Elevations, row after row, each from low to high x. `(rows, columns)` [m]
    pub elevations: Vec<f64>,
    /// Height of the flat bottom, below all elevations [m].
    pub bottom: f64,
    /// Its file, if it is of one.
    pub path: PathBuf,
}

impl HeightField {
    /// A field of `(rows, columns)` elevations [m] over lengths along x and y [m], whose bottom is `base` [m] below the lowest.
    ///
    /// # Errors
    /// What is wrong with it, with the cure.
    pub fn new(
        [rows, columns]: [usize; 2],
        elevations: Vec<f64>,
        size: [f64; 2],
        base: f64,
    ) -> Result<HeightField, String> {
        if rows < 2 || columns < 2 || elevations.len() != rows * columns {
            return Err(format!(
                "its elevations are {rows} rows of {columns}; a height field needs two of each"
            ));
        }
        if elevations.len() > SAMPLES_MAX {
            return Err(format!(
                "it has {} samples, more than {SAMPLES_MAX}; make it coarser or smaller",
                elevations.len()
            ));
        }
        if let Some(x) = elevations.iter().find(|x| x.is_nan() || x.abs() > 1e6) {
            return Err(format!(
                "it has the elevation {x} m; give finite ones of at most 1e6 m"
            ));
        }
        for length in size {
            if !(length > 0.0 && length <= 1e6) {
                return Err(format!(
                    "its size is {length} m; give lengths above 0, at most 1e6 m"
                ));
            }
        }
        if !(base > 0.0 && base <= 1e6) {
            return Err(format!(
                "its base is {base} m; give the thickness below the lowest elevation, above 0 m"
            ));
        }
        let lowest = elevations.iter().copied().fold(f64::INFINITY, f64::min);
        Ok(HeightField {
            rows,
            columns,
            half: size.map(|length| 0.5 * length),
            elevations,
            bottom: lowest - base,
            path: PathBuf::new(),
        })
    }

    /// Reads the elevations of a file that NumPy's `save` wrote: two-dimensional, of float64 or float32.
    ///
    /// # Errors
    /// Why the file cannot be used, by its path, with the cure.
    pub fn load(path: &Path, size: [f64; 2], base: f64) -> Result<HeightField, ModelError> {
        let what = || format!("height field {}", path.display());
        let refuse = |reason| ModelError::HeightField(what(), reason);
        let bytes = files::read(path, FILE_MAX)
            .map_err(|error| refuse(format!("{}; give a .npy file", error.reason())))?;
        let (shape, elevations) = npy(&bytes).ok_or_else(|| {
            refuse(
                "it is no array of elevations; write it by numpy.save, with two axes, as float64 or float32"
                    .to_owned(),
            )
        })?;
        let field = HeightField::new(shape, elevations, size, base).map_err(refuse)?;
        Ok(HeightField {
            path: path.to_owned(),
            ..field
        })
    }

    /// Lengths of a cell along x and y [m].
    pub fn cell(&self) -> [f64; 2] {
        [
            2.0 * self.half[0] / (self.columns - 1) as f64,
            2.0 * self.half[1] / (self.rows - 1) as f64,
        ]
    }

    /// Lowest and highest elevation [m].
    pub fn range(&self) -> [f64; 2] {
        let all = || self.elevations.iter().copied();
        [
            all().fold(f64::INFINITY, f64::min),
            all().fold(f64::NEG_INFINITY, f64::max),
        ]
    }

    /// Its surface: top, walls and bottom.
    pub fn surface(&self) -> TriMesh {
        let (rows, columns, cell) = (self.rows, self.columns, self.cell());
        let place = |row: usize, column: usize| {
            let along = |axis: usize, i: usize| cell[axis] * i as f64 - self.half[axis];
            [along(0, column), along(1, row)]
        };
        let samples = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let mut vertices: Vec<[f64; 3]> = samples
            .map(|(row, column)| {
                let [x, y] = place(row, column);
                [x, y, self.elevations[row * columns + column]]
            })
            .collect();
        let mut triangles = Vec::with_capacity(2 * (rows - 1) * (columns - 1));
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let p = (row * columns + column) as u32;
                let (right, above) = (p + 1, p + columns as u32);
                triangles.extend([[p, above + 1, above], [p, right, above + 1]]);
            }
        }
        // once around, counter-clockwise from above
        let last = (rows - 1, columns - 1);
        let around: Vec<(usize, usize)> = (0..last.1)
            .map(|column| (0, column))
            .chain((0..last.0).map(|row| (row, last.1)))
            .chain((1..=last.1).rev().map(|column| (last.0, column)))
            .chain((1..=last.0).rev().map(|row| (row, 0)))
            .collect();
        let first = vertices.len() as u32;
        vertices.extend(around.iter().map(|&(row, column)| {
            let [x, y] = place(row, column);
            [x, y, self.bottom]
        }));
        for (i, &(row, column)) in around.iter().enumerate() {
            let next = (i + 1) % around.len();
            let (a, b) = ((row * columns + column) as u32, around[next]);
            let b = (b.0 * columns + b.1) as u32;
            let (c, d) = (first + i as u32, first + next as u32);
            triangles.extend([[a, c, d], [a, d, b]]);
        }
        let middle = vertices.len() as u32;
        vertices.push([0.0, 0.0, self.bottom]);
        triangles.extend((0..around.len()).map(|i| {
            let next = (i + 1) % around.len();
            [middle, first + next as u32, first + i as u32]
        }));
        TriMesh {
            vertices,
            triangles,
        }
    }

    /// What rays meet in MuJoCo (`mj_rayHfield`): the surface, and the top of the box below it, at height 0.
    pub fn ray_surface(&self) -> TriMesh {
        let TriMesh {
            mut vertices,
            mut triangles,
        } = self.surface();
        let first = vertices.len() as u32;
        let [x, y] = self.half;
        vertices.extend([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]);
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        TriMesh {
            vertices,
            triangles,
        }
    }
}

/// Shape and scalars of a file of NumPy's format with two axes.
fn npy(bytes: &[u8]) -> Option<([usize; 2], Vec<f64>)> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (&[major, _], rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = match major {
        1 => {
            let (&length, rest) = rest.split_first_chunk::<2>()?;
            (usize::from(u16::from_le_bytes(length)), rest)
        }
        _ => {
            let (&length, rest) = rest.split_first_chunk::<4>()?;
            (usize::try_from(u32::from_le_bytes(length)).ok()?, rest)
        }
    };
    let (header, data) = rest.split_at_checked(length)?;
    let header = std::str::from_utf8(header).ok()?;
    let value = |key: &str| {
        header
            .split_once(key)?
            .1
            .split_once(':')
            .map(|(_, x)| x.trim())
    };
    if !value("'fortran_order'")?.starts_with("False") {
        return None;
    }
    let shape = value("'shape'")?.strip_prefix('(')?.split_once(')')?.0;
    let mut axes = shape.split(',').map(str::trim);
    let mut axis = || axes.next()?.parse::<usize>().ok();
    let shape = [axis()?, axis()?];
    if axes.any(|more| !more.is_empty()) {
        return None;
    }
    let kind = value("'descr'")?;
    let numbers: Vec<f64> = if kind.starts_with("'<f8'") {
        let (numbers, _) = data.as_chunks::<8>();
        numbers.iter().map(|&x| f64::from_le_bytes(x)).collect()
    } else if kind.starts_with("'<f4'") {
        let (numbers, _) = data.as_chunks::<4>();
        let numbers = numbers.iter().map(|&x| f32::from_le_bytes(x));
        numbers.map(f64::from).collect()
    } else {
        return None;
    };
    (numbers.len() == shape[0].checked_mul(shape[1])?).then_some((shape, numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hill() -> HeightField {
        let elevations = (0..12).map(|k| f64::from(k * k % 7)).collect();
        HeightField::new([3, 4], elevations, [3.0, 2.0], 0.5).unwrap()
    }

    #[test]
    fn its_surface_encloses_the_volume_of_its_prisms() {
        let field = hill();
        let [dx, dy] = field.cell();
        let mut volume = 0.0;
        for row in 0..2 {
            for column in 0..3 {
                let h = |r: usize, c: usize| field.elevations[(row + r) * 4 + column + c];
                let mean = (2.0 * (h(0, 0) + h(1, 1)) + h(0, 1) + h(1, 0)) / 6.0;
                volume += dx * dy * (mean - field.bottom);
            }
        }
        let enclosed = field.surface().signed_volume();
        assert!(
            (enclosed - volume).abs() < 1e-12 * volume,
            "{enclosed} {volume}"
        );
    }

    #[test]
    fn bytes_of_another_kind_are_refused() {
        assert!(npy(b"\x93NUMPY\x01\x00\x02\x00{}").is_none());
        assert!(npy(b"solid").is_none());
    }
}
