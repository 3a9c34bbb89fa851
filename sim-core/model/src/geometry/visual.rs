//! What a mesh file looks like: triangles in the colours and images of its materials.
//!
//! Nothing here has a part in physics. Images are not opened: a texture names the colours that a viewer looks up.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::TriMesh;
use super::cluster::{Clustered, cluster, used};
use super::load::{Material, NO_AREA, RawMesh, Run, Uv, read};
use crate::error::ModelError;

/// Most triangles of a mesh that are shown; what has more is shown with fewer.
pub const TRIANGLES_SHOWN_MAX: usize = 200_000;

/// Red, green, blue and opacity as a screen shows them, 0 to 255.
pub type Color = [u8; 4];

/// An image of a texture.
#[derive(Clone, Debug, PartialEq)]
pub enum Image {
    /// A file, there or not.
    File(PathBuf),
    /// The bytes of a PNG or JPEG file.
    Bytes(Vec<u8>),
}

/// Triangles that an image gives its colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image.
    pub image: Image,
    /// Indices of the triangles.
    pub triangles: Vec<u32>,
    /// Where their corners lie in the image, which repeats: (0, 0) is bottom left, (1, 1) top right; `(triangles, 3, 2)`.
    /// `None` where the file does not say.
    pub uv: Option<Vec<[[f32; 2]; 3]>>,
    /// What the image's colours are multiplied with, over 255; `(triangles,)`.
    pub tints: Vec<Color>,
}

/// A mesh file as it looks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisualMesh {
    /// Positions. `(vertices, 3)` [m]
    pub vertices: Vec<[f32; 3]>,
    /// Indices of the corners, counter-clockwise from outside. `(triangles, 3)`
    pub triangles: Vec<[u32; 3]>,
    /// Colour of each triangle; of those with a texture, the one to show without its image. `None` where the file gives
    /// none. `(triangles,)`
    pub colors: Vec<Option<Color>>,
    /// Images; a triangle has one at most.
    pub textures: Vec<Texture>,
    /// What was done to it that its author may not expect, a sentence each without a subject.
    pub notes: Vec<String>,
    /// The axis that its file says is up, where that is not z and was not applied.
    pub ignored_up_axis: Option<&'static str>,
}

impl VisualMesh {
    /// Reads a mesh file, vertices at the same place joined; of more than [`TRIANGLES_SHOWN_MAX`] triangles, fewer are made.
    /// `collada_up_axis` as in [`super::MeshOptions`].
    ///
    /// # Errors
    /// Why the file cannot be used, by its path, with the cure. Materials and images that are broken are no reason.
    pub fn load(path: &Path, collada_up_axis: bool) -> Result<VisualMesh, ModelError> {
        let fault = |reason| ModelError::Mesh {
            owner: String::new(),
            path: path.to_owned(),
            reason,
        };
        let RawMesh {
            vertices,
            triangles,
            runs,
            notes,
            ignored_up_axis,
            beside: _,
        } = read(path, true, collada_up_axis).map_err(fault)?;
        let (vertices, triangles, mut origins) = joined(&vertices, &triangles);
        if triangles.is_empty() {
            return Err(fault(NO_AREA.to_owned()));
        }
        let mut mesh = VisualMesh {
            vertices,
            triangles,
            notes,
            ignored_up_axis,
            ..VisualMesh::default()
        };
        if let Some(kept) = mesh.thin() {
            origins = kept.into_iter().map(|index| origins[index]).collect();
        }
        mesh.paint(&runs, &origins);
        Ok(mesh)
    }

    /// Fewer triangles where there are too many, and which ones these were.
    fn thin(&mut self) -> Option<Vec<usize>> {
        let count = self.triangles.len();
        if count <= TRIANGLES_SHOWN_MAX {
            return None;
        }
        let thin = cluster(&self.vertices, &self.triangles, TRIANGLES_SHOWN_MAX);
        self.notes.push(thinned(count, &thin));
        self.vertices = thin.vertices;
        self.triangles = thin.triangles;
        Some(thin.kept)
    }

    /// Colours and textures of the triangles, which were these of the file, in its order.
    fn paint(&mut self, runs: &[Run], origins: &[usize]) {
        self.colors = vec![None; origins.len()];
        let mut textures: HashMap<_, usize> = HashMap::new();
        let mut next = 0;
        for run in runs {
            let end = run.first + run.count;
            while next < origins.len() && origins[next] < end {
                let Some(place) = origins[next].checked_sub(run.first) else {
                    next += 1; // before the first run
                    continue;
                };
                let Material { color, texture } = &run.material;
                let run_color = run.colors.get(place).copied();
                self.colors[next] = run_color.or(*color);
                if let Some(textured) = texture {
                    let uv: Option<&Uv> = run.uv.get(place);
                    let key = (Rc::as_ptr(&textured.image), uv.is_some());
                    let textures_known = self.textures.len();
                    let index = *textures.entry(key).or_insert(textures_known);
                    if index == textures_known {
                        self.textures.push(Texture {
                            image: (*textured.image).clone(),
                            triangles: Vec::new(),
                            uv: uv.map(|_| Vec::new()),
                            tints: Vec::new(),
                        });
                    }
                    let texture = &mut self.textures[index];
                    texture.triangles.push(next as u32);
                    texture.tints.push(run_color.unwrap_or(textured.tint));
                    if let (Some(all), Some(uv)) = (&mut texture.uv, uv) {
                        all.push(*uv);
                    }
                }
                next += 1;
            }
        }
    }
}

impl TriMesh {
    /// The mesh as it is shown: with fewer triangles where there are more than [`TRIANGLES_SHOWN_MAX`], and a note on it, a
    /// sentence without a subject.
    pub fn thinned(self) -> (TriMesh, Option<String>) {
        let count = self.triangles.len();
        if count <= TRIANGLES_SHOWN_MAX {
            return (self, None);
        }
        let (vertices, triangles, _) = joined(&self.vertices, &self.triangles);
        let thin = cluster(&vertices, &triangles, TRIANGLES_SHOWN_MAX);
        let note = thinned(count, &thin);
        let mesh = TriMesh {
            vertices: thin.vertices.iter().map(|v| v.map(f64::from)).collect(),
            triangles: thin.triangles,
        };
        (mesh, Some(note))
    }
}

fn thinned(count: usize, thin: &Clustered) -> String {
    format!(
        "has {} triangles and is shown with {}, {} mm apart",
        grouped(count),
        grouped(thin.triangles.len()),
        two_digits(1000.0 * thin.cell),
    )
}

/// A mesh in f32, vertices at the same place joined and triangles of which two corners are one left out, and which triangle
/// each was.
fn joined(
    vertices: &[[f64; 3]],
    triangles: &[[u32; 3]],
) -> (Vec<[f32; 3]>, Vec<[u32; 3]>, Vec<usize>) {
    let mut place_of: HashMap<[u32; 3], u32> = HashMap::with_capacity(vertices.len());
    let mut distinct: Vec<[f32; 3]> = Vec::new();
    let renamed: Vec<u32> = vertices
        .iter()
        .map(|vertex| {
            // -0 + 0 is 0: the two zeros are one place
            let place = vertex.map(|x| x as f32 + 0.0);
            *place_of.entry(place.map(f32::to_bits)).or_insert_with(|| {
                distinct.push(place);
                distinct.len() as u32 - 1
            })
        })
        .collect();
    let (kept, origins): (Vec<_>, Vec<_>) = triangles
        .iter()
        .map(|corners| corners.map(|corner| renamed[corner as usize]))
        .enumerate()
        .filter(|(_, [a, b, c])| a != b && b != c && c != a)
        .map(|(origin, corners)| (corners, origin))
        .unzip();
    let (vertices, triangles) = used(&distinct, kept);
    (vertices, triangles, origins)
}

/// A number with its thousands apart: `1,234,567`.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    let (head, rest) = digits.split_at(first);
    let groups = rest.as_bytes().chunks(3).map(String::from_utf8_lossy);
    let head = (!head.is_empty()).then_some(head.into());
    head.into_iter().chain(groups).collect::<Vec<_>>().join(",")
}

/// A positive number with two digits that count.
fn two_digits(number: f64) -> String {
    let decimals = (1.0 - number.log10().floor()).clamp(0.0, 12.0);
    format!("{number:.*}", decimals as usize)
}
