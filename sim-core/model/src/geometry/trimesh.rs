//! Triangles with shared vertices: joined, oriented outward, and sorted into solids and open surfaces.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::vector::{Vector, area_vector, cross, dot, norm, six_volumes, sub};

/// Most work on finding which shells are cavities [triangles visited]: a second or two.
const CAVITY_WORK_MAX: usize = 1 << 27;

/// Triangles with shared vertices, counter-clockwise from outside where they have one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriMesh {
    /// Positions. `(vertices, 3)` [m]
    pub vertices: Vec<[f64; 3]>,
    /// Indices of the corners. `(triangles, 3)`
    pub triangles: Vec<[u32; 3]>,
}

impl TriMesh {
    /// Corners of one triangle [m].
    pub fn corners(&self, triangle: [u32; 3]) -> [[f64; 3]; 3] {
        triangle.map(|vertex| self.vertices[vertex as usize])
    }

    /// Lowest and highest coordinates [m].
    pub fn extent(&self) -> [[f64; 3]; 2] {
        super::vector::extent(&self.vertices)
    }

    /// Signed volume by the divergence theorem, Σ a·(b × c) / 6 about the first vertex [m³].
    pub fn signed_volume(&self) -> f64 {
        self.triangles
            .iter()
            .map(|&triangle| self.signed_part(triangle))
            .sum::<f64>()
            / 6.0
    }

    /// Six times the signed volume of the tetrahedron between a triangle and the first vertex [m³].
    fn signed_part(&self, triangle: [u32; 3]) -> f64 {
        // about a point of the mesh, far from the origin nothing is lost
        let origin = self.vertices[0];
        six_volumes(origin, self.corners(triangle))
    }

    /// Joins vertices at the same place, and leaves out triangles without area and vertices without triangle.
    pub(super) fn joined(self) -> TriMesh {
        let mut place_of: HashMap<[u64; 3], u32> = HashMap::with_capacity(self.vertices.len());
        let mut joined = TriMesh::default();
        let mut renamed = vec![u32::MAX; self.vertices.len()];
        for &triangle in &self.triangles {
            if norm(area_vector(self.corners(triangle))) == 0.0 {
                continue;
            }
            joined.triangles.push(triangle.map(|vertex| {
                let new = &mut renamed[vertex as usize];
                if *new == u32::MAX {
                    // -0 + 0 is 0: the two zeros are one place
                    let place = self.vertices[vertex as usize].map(|x| x + 0.0);
                    *new = *place_of.entry(place.map(f64::to_bits)).or_insert_with(|| {
                        joined.vertices.push(place);
                        joined.vertices.len() as u32 - 1
                    });
                }
                *new
            }));
        }
        joined
    }

    /// Turns every triangle over.
    pub(super) fn turn_over(&mut self) {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
    }

    /// Whether it bounds a solid: along every edge as many triangles run forth as back, so that the volume does not
    /// depend on the origin.
    pub fn is_closed(&self) -> bool {
        let mut balance: HashMap<(u32, u32), i32> =
            HashMap::with_capacity(self.triangles.len() * 3 / 2);
        for &[a, b, c] in &self.triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let (edge, way) = if from < to {
                    ((from, to), 1)
                } else {
                    ((to, from), -1)
                };
                *balance.entry(edge).or_insert(0) += way;
            }
        }
        !self.triangles.is_empty() && balance.values().all(|&sum| sum == 0)
    }

    /// Turns the shells of a closed mesh outward, cavities inward.
    ///
    /// A solid that is inside out as a whole is turned over. Then a shell that is inside out is a cavity if the others
    /// enclose it; if not, its triangles were written in the wrong order. Returns false if there are too many shells to
    /// decide.
    pub(super) fn turn_outward(&mut self) -> bool {
        if self.signed_volume() < 0.0 {
            self.turn_over();
        }
        let (shell_of, shells) = self.shells();
        let mut volumes = vec![0.0; shells];
        for (&triangle, &shell) in self.triangles.iter().zip(&shell_of) {
            volumes[shell] += self.signed_part(triangle);
        }
        let inward: Vec<usize> = (0..shells).filter(|&shell| volumes[shell] < 0.0).collect();
        if inward.len().saturating_mul(self.triangles.len()) > CAVITY_WORK_MAX {
            return false;
        }
        let lost: Vec<usize> = inward
            .into_iter()
            .filter(|&shell| !self.encloses(shell, &shell_of, &volumes))
            .collect();
        for (triangle, shell) in self.triangles.iter_mut().zip(&shell_of) {
            if lost.contains(shell) {
                triangle.swap(1, 2);
            }
        }
        true
    }

    /// Whether the outward shells surround this one: their solid angle seen from it is 4π, or 0 from outside.
    fn encloses(&self, shell: usize, shell_of: &[usize], volumes: &[f64]) -> bool {
        let seen_from = self
            .triangles
            .iter()
            .zip(shell_of)
            .find(|&(_, &of)| of == shell)
            .map(|(triangle, _)| self.vertices[triangle[0] as usize]);
        let Some(eye) = seen_from else { return false };
        let angle: f64 = self
            .triangles
            .iter()
            .zip(shell_of)
            .filter(|&(_, &of)| volumes[of] > 0.0)
            .map(|(&triangle, _)| {
                solid_angle(self.corners(triangle).map(|corner| sub(corner, eye)))
            })
            .sum();
        angle > 2.0 * std::f64::consts::PI
    }

    /// The shell of each triangle, which are those that share vertices, and how many there are.
    fn shells(&self) -> (Vec<usize>, usize) {
        let mut parent: Vec<u32> = (0..self.vertices.len() as u32).collect();
        for &[a, b, c] in &self.triangles {
            let root = root_of(&mut parent, a);
            for other in [b, c] {
                let other = root_of(&mut parent, other);
                parent[other as usize] = root;
            }
        }
        let mut number = HashMap::new();
        let shell_of = self
            .triangles
            .iter()
            .map(|triangle| {
                let root = root_of(&mut parent, triangle[0]);
                let next = number.len();
                *number.entry(root).or_insert(next)
            })
            .collect();
        (shell_of, number.len())
    }
}

/// Root of a tree of a disjoint-set forest, halving the path to it.
fn root_of(parent: &mut [u32], mut node: u32) -> u32 {
    while parent[node as usize] != node {
        let above = parent[parent[node as usize] as usize];
        parent[node as usize] = above;
        node = above;
    }
    node
}

/// Solid angle of a triangle seen from the origin, positive from inside (van Oosterom and Strackee 1983) [sr].
fn solid_angle([a, b, c]: [Vector; 3]) -> f64 {
    let (la, lb, lc) = (norm(a), norm(b), norm(c));
    let volume = dot(a, cross(b, c));
    let across = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    2.0 * libm::atan2(volume, across)
}
