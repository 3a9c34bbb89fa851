//! A polytope around the origin that grows by one vertex at a time.

use super::nearest::project_onto_plane;
use super::solid::Vertex;
use super::vector::{Point, TINY, dot, scale, sub};
use crate::constants::hull::reference::ITERATIONS_MAX;
use arrayvec::ArrayVec;

/// Vertices beside those of iterations.
const FIRST_VERTICES: usize = 5;
/// Most faces.
const FACES_MAX: usize = FACES * ITERATIONS_MAX;
/// Faces per iteration.
const FACES: usize = 6;
/// Most edges of a horizon.
const HORIZON_MAX: usize = ITERATIONS_MAX;

/// A triangle.
#[derive(Clone, Copy, Debug)]
pub struct Face {
    /// Its corners, counter-clockwise.
    pub corners: [usize; 3],
    /// The faces across its edges; edge k begins at corner k.
    across: [usize; 3],
    /// The point of its plane nearest to the origin [m].
    pub nearest: Point,
    /// The square of its distance [m²].
    pub square: f64,
    /// Its place among the candidates, if it is one.
    place: Option<usize>,
    is_gone: bool,
}

/// Vertices and faces, and those faces that may be nearest to the origin.
#[derive(Clone, Debug)]
pub struct Polytope {
    pub vertices: ArrayVec<Vertex, { ITERATIONS_MAX + FIRST_VERTICES }>,
    pub faces: ArrayVec<Face, FACES_MAX>,
    pub candidates: ArrayVec<usize, FACES_MAX>,
    /// A point inside.
    pub inside: Point,
    /// Faces that it may have.
    faces_max: usize,
}

/// How a polytope took a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growth {
    Done,
    /// It has no room.
    Full,
    /// Rounding broke it.
    Broken,
}

/// Edges around what a new vertex sees: the face beyond, and which edge of it.
type Horizon = ArrayVec<(usize, usize), HORIZON_MAX>;

impl Polytope {
    pub fn new(iterations: usize) -> Self {
        Polytope {
            vertices: ArrayVec::new(),
            faces: ArrayVec::new(),
            candidates: ArrayVec::new(),
            inside: [0.0; 3],
            faces_max: FACES * iterations,
        }
    }

    pub fn clear(&mut self) {
        self.vertices.clear();
        self.faces.clear();
        self.candidates.clear();
    }

    pub fn add_vertex(&mut self, vertex: Vertex) -> usize {
        self.vertices.push(vertex);
        self.vertices.len() - 1
    }

    /// Adds a face with its neighbours, and returns the square of its distance; 0 where it has no area.
    pub fn add_face(&mut self, corners: [usize; 3], across: [usize; 3]) -> f64 {
        // its plane is nearest to the origin at the projection of that
        let [a, b, c] = corners.map(|corner| self.vertices[corner].point);
        let mut face = Face {
            corners,
            across,
            nearest: [0.0; 3],
            square: 0.0,
            place: None,
            is_gone: false,
        };
        if let Some(nearest) = project_onto_plane(c, b, a) {
            // away from the inside, should the origin be on the face
            let is_outward = dot(nearest, sub(a, self.inside)) >= 0.0;
            face.nearest = match is_outward {
                true => nearest,
                false => scale(nearest, -1.0),
            };
            face.square = dot(nearest, nearest);
        }
        self.faces.push(face);
        face.square
    }

    /// Makes a face a candidate.
    pub fn consider(&mut self, face: usize) {
        self.faces[face].place = Some(self.candidates.len());
        self.candidates.push(face);
    }

    /// The candidate nearest to the origin; of equal ones the first.
    pub fn nearest_candidate(&self) -> Option<usize> {
        // a list, not a heap: faces are few, and ties keep MuJoCo's order
        let mut nearest: Option<usize> = None;
        for &face in &self.candidates {
            let is_nearer = |other: usize| self.faces[face].square < self.faces[other].square;
            if nearest.is_none_or(is_nearer) {
                nearest = Some(face);
            }
        }
        nearest
    }

    fn remove(&mut self, face: usize) {
        // the last candidate takes the free place
        if let Some(place) = self.faces[face].place.take() {
            self.candidates.swap_remove(place);
            if let Some(&moved) = self.candidates.get(place) {
                self.faces[moved].place = Some(place);
            }
        }
        self.faces[face].is_gone = true;
    }

    /// Replaces all faces that a vertex sees, of which `face` is one. New faces whose squared distance is in the range are
    /// candidates.
    pub fn grow(&mut self, vertex: usize, face: usize, range: [f64; 2]) -> Growth {
        // from the face across each of its edges, as far as the vertex sees
        let point = self.vertices[vertex].point;
        let mut horizon = Horizon::new();
        self.remove(face);
        for k in 0..3 {
            let (other, edge) = self.beyond(face, k);
            let is_there = k == 0 || !self.faces[other].is_gone;
            if is_there && !self.cut(point, other, edge, &mut horizon) {
                // a full horizon is noticed below
                let _ = horizon.try_push((other, edge));
            }
        }
        if horizon.len() < 3 || horizon.is_full() {
            return Growth::Broken;
        }
        // a fan of new faces between the vertex and the horizon
        let (first, count) = (self.faces.len(), horizon.len());
        if first + count > self.faces_max {
            return Growth::Full;
        }
        for (k, &(other, edge)) in horizon.iter().enumerate() {
            let corners = self.faces[other].corners;
            let (from, to) = (corners[edge], corners[(edge + 1) % 3]);
            // the new face and the old one are across the edge from each other
            self.faces[other].across[edge] = first + k;
            let neighbours = [
                first + (k + count - 1) % count,
                other,
                first + (k + 1) % count,
            ];
            let square = self.add_face([vertex, to, from], neighbours);
            // farther than the bound of the depth, it cannot be the nearest
            if square == 0.0 {
                return Growth::Broken;
            }
            if square >= range[0] && square <= range[1] {
                self.consider(first + k);
            }
        }
        Growth::Done
    }

    /// The face across an edge, and which edge of it that is.
    fn beyond(&self, face: usize, edge: usize) -> (usize, usize) {
        let Face {
            corners, across, ..
        } = self.faces[face];
        // neighbours run along their common edge in opposite directions
        let (other, end) = (across[edge], corners[(edge + 1) % 3]);
        let mut beside = self.faces[other].corners.iter();
        (other, beside.position(|&corner| corner == end).unwrap_or(2))
    }

    /// Removes a face that a point sees with all that it sees beyond, and adds the edges where it sees no farther. Returns
    /// whether it sees the face.
    fn cut(&mut self, point: Point, face: usize, edge: usize, horizon: &mut Horizon) -> bool {
        let Face {
            nearest, square, ..
        } = self.faces[face];
        let sees = dot(nearest, point) - square > TINY;
        if sees {
            // on across the two other edges
            self.remove(face);
            for k in 1..3 {
                let (other, other_edge) = self.beyond(face, (edge + k) % 3);
                if !self.faces[other].is_gone && !self.cut(point, other, other_edge, horizon) {
                    let _ = horizon.try_push((other, other_edge));
                }
            }
        }
        sees
    }
}
