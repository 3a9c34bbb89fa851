//! Triangles and materials as a file gives them.

use std::rc::Rc;

use serde::{Deserialize, Serialize};

use super::super::vector::Vector;
use super::super::visual::{Color, Image};
use super::Limits;
use super::scene::Affine;
use crate::cache_files::DIGEST;

/// Triangles of a file, with what is known of their looks.
#[derive(Default)]
pub(in super::super) struct RawMesh {
    pub vertices: Vec<Vector>,
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles that share a material, in order; empty unless looks are asked for.
    pub runs: Vec<Run>,
    /// What was done to it that its author may not expect, a sentence each.
    pub notes: Vec<String>,
    /// The axis that the file says is up, where that is not z and was not applied.
    pub ignored_up_axis: Option<&'static str>,
    /// Other files whose bytes are in the triangles.
    pub beside: Vec<Beside>,
}

/// A file beside a mesh file, whose bytes are part of the mesh.
#[derive(Clone, Serialize, Deserialize)]
pub(in super::super) struct Beside {
    /// Its path from the folder of the mesh file.
    pub path: String,
    pub digest: [u8; DIGEST],
}

/// Colour and image of a material.
#[derive(Clone, Default)]
pub(in super::super) struct Material {
    /// Without its image; `None` where the file gives no colour.
    pub color: Option<Color>,
    pub texture: Option<Texture>,
}

/// An image, and the colour that it is multiplied with.
#[derive(Clone)]
pub(in super::super) struct Texture {
    pub image: Rc<Image>,
    pub tint: Color,
}

/// Texture coordinates of a triangle's corners: (0, 0) is bottom left, (1, 1) top right.
pub(in super::super) type Uv = [[f32; 2]; 3];

/// Successive triangles of one material.
#[derive(Clone, Default)]
pub(in super::super) struct Run {
    /// Index of the first triangle.
    pub first: usize,
    /// How many triangles.
    pub count: usize,
    pub material: Material,
    /// One colour per triangle, in place of the material's colour and tint; or none.
    pub colors: Vec<Color>,
    /// One per triangle, or none.
    pub uv: Vec<Uv>,
}

impl RawMesh {
    /// Adds a triangle with corners of its own.
    pub fn triangle(&mut self, corners: [Vector; 3]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Adds triangles of these corners, each by three places in the list of corners.
    pub fn extend(&mut self, corners: &[u32], places: &[[usize; 3]]) {
        let triangles = places.iter().map(|places| places.map(|at| corners[at]));
        self.triangles.extend(triangles);
    }

    /// Adds a part of a scene where this map puts it; a map that mirrors keeps the outside outside.
    pub(super) fn place(
        &mut self,
        part: &RawMesh,
        map: &Affine,
        limits: Limits,
    ) -> Result<(), String> {
        limits.triangles(self.triangles.len() + part.triangles.len())?;
        limits.vertices(self.vertices.len() + part.vertices.len())?;
        let first = self.vertices.len() as u32;
        let first_triangle = self.triangles.len();
        let places = part.vertices.iter().map(|&vertex| map.apply(vertex));
        self.vertices.extend(places);
        let mirrors = map.mirrors();
        self.triangles.extend(part.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| first + corner);
            if mirrors { [a, c, b] } else { [a, b, c] }
        }));
        for run in &part.runs {
            let mut run = run.clone();
            run.first += first_triangle;
            if mirrors {
                run.uv.iter_mut().for_each(|uv| uv.swap(1, 2));
            }
            self.runs.push(run);
        }
        Ok(())
    }
}

/// A polygon of so many corners as a fan around its first; integrals over it come out right even where it is concave.
pub(super) fn fan(first: usize, count: usize) -> impl Iterator<Item = [usize; 3]> {
    (2..count).map(move |corner| [first, first + corner - 1, first + corner])
}

/// A strip of triangles, every other of which runs the other way.
pub(super) fn strip(count: usize) -> impl Iterator<Item = [usize; 3]> {
    (2..count).map(|last| {
        let (first, swap) = (last - 2, last % 2);
        [first, first + 1 + swap, first + 2 - swap]
    })
}

/// Separate triangles; corners beyond the last whole one are left out.
pub(super) fn separate(count: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..count / 3).map(|index| [3 * index, 3 * index + 1, 3 * index + 2])
}
