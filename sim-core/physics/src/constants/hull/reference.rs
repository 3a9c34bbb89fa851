//! What the search for contacts in double precision reads beside the tables; see `step::collide::reference`.

use super::resting::resting;
use crate::constants::recast::{Recast, same};
use std::sync::Arc;

/// Most iterations of a search.
pub const ITERATIONS_MAX: usize = 250;
/// Most corners of a face.
pub const CORNERS_MAX: usize = 512;
/// Most faces around a vertex.
pub const AROUND_MAX: usize = 256;

/// MuJoCo's search for the contacts of two shapes without a closed form.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceSearch {
    /// Does `f64` use it?
    pub is_used: bool,
    /// When it ends.
    pub limits: Limits,
    /// The model's hulls in the order of the tables; none for a hull that the search has no room for.
    pub hulls: Vec<Option<ReferenceHull>>,
}

/// When a search ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Most iterations of GJK, and of EPA; MuJoCo's `ccd_iterations`, from 1 to [`ITERATIONS_MAX`].
    pub iterations: usize,
    /// Of a distance, `ccd_tolerance` [m].
    pub tolerance: f64,
    /// Whether two shapes touch in several points; not with the flag `mjDSBL_MULTICCD`.
    pub several: bool,
}

impl Default for Limits {
    /// Those of MuJoCo.
    fn default() -> Limits {
        Limits {
            iterations: 35,
            tolerance: 1e-6,
            several: true,
        }
    }
}

/// A hull in the frame of its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceHull {
    /// Origin of that frame in the frame of the tables [m].
    pub origin: [f64; 3],
    /// In the order in which equally far ones count. `(vertices, 3)` [m]
    pub vertices: Vec<[f64; 3]>,
    /// Corners of each face, counter-clockwise from outside.
    pub faces: Vec<Vec<u32>>,
    /// Their outward unit normals. `(faces, 3)` [–]
    pub normals: Vec<[f64; 3]>,
    /// The faces around each vertex, rising.
    pub around: Vec<Vec<u32>>,
    /// Of each of these faces, the corners that rest on a plane with the vertex.
    pub resting: Vec<Vec<Vec<u32>>>,
}

impl ReferenceHull {
    /// A hull with these vertices, and with faces by their corners and normals; none where the search has no room for it.
    pub fn new(
        origin: [f64; 3],
        vertices: Vec<[f64; 3]>,
        sides: impl Iterator<Item = (Vec<u32>, [f64; 3])>,
    ) -> Option<ReferenceHull> {
        let (faces, normals): (Vec<Vec<u32>>, Vec<[f64; 3]>) = sides.unzip();
        let mut around = vec![Vec::new(); vertices.len()];
        let mut beside = vec![Vec::new(); vertices.len()];
        for (side, corners) in faces.iter().enumerate() {
            for (at, &corner) in corners.iter().enumerate() {
                around.get_mut(corner as usize)?.push(side as u32);
                beside[corner as usize].push(resting(&vertices, corners, at));
            }
        }
        let has_room = faces.iter().all(|corners| corners.len() <= CORNERS_MAX)
            && around.iter().all(|sides| sides.len() <= AROUND_MAX);
        (has_room && !vertices.is_empty()).then_some(ReferenceHull {
            origin,
            vertices,
            faces,
            normals,
            around,
            resting: beside,
        })
    }

    /// The vertex farthest along a direction. Of equally far ones `last` counts, else the first.
    pub fn farthest(&self, [x, y, z]: [f64; 3], last: Option<u32>) -> u32 {
        let reach = |[a, b, c]: [f64; 3]| x * a + y * b + z * c;
        let start = last.unwrap_or(0);
        let mut best = (start, reach(self.vertices[start as usize]));
        for (k, vertex) in self.vertices.iter().enumerate() {
            let reach = reach(*vertex);
            if reach > best.1 {
                best = (k as u32, reach);
            }
        }
        best.0
    }

    /// The faces that have all of some corners; of those with two corners the first two, with three the first.
    pub fn sides(&self, corners: &[u32]) -> impl Iterator<Item = u32> {
        let around = self.around[corners[0] as usize].iter().copied();
        let has = |side: u32, corner: u32| self.around[corner as usize].contains(&side);
        let all = around.filter(move |side| corners[1..].iter().all(|k| has(*side, *k)));
        all.take([usize::MAX, 2, 1][corners.len() - 1])
    }

    /// The corner before this one in each face around it.
    pub fn corners_before(&self, corner: u32) -> impl Iterator<Item = u32> {
        let sides = self.around[corner as usize].iter();
        sides.map(move |&side| {
            let face = &self.faces[side as usize];
            let place = face.iter().position(|&k| k == corner).unwrap_or(0);
            face[(place + face.len() - 1) % face.len()]
        })
    }
}

same! { Arc<ReferenceSearch> }
