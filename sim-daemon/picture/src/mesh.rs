//! What is drawn: triangles with normals and colours, and coarser copies of them for where they are small.

use std::collections::{BTreeMap, HashMap};

use crate::normals::{corner_normals, facet_normals};
use crate::vector::{cross, dot};

/// Cells along the longest side of a mesh in its coarser copies.
const COARSER: [f32; 4] = [128.0, 64.0, 32.0, 16.0];
/// A copy is worth its memory where it saves this share of the triangles.
const WORTH: f64 = 0.7;

/// Triangles of the largest mesh that is one piece, and about how many a piece of a larger one has.
const WHOLE_MAX: usize = 200_000;
const PIECE: usize = 32_768;

/// How triangles that meet are shaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shading {
    /// Those that meet at a small angle look round.
    Smooth,
    /// Each is seen as it is: small steps of the ground stay sharp.
    Flat,
}

/// Why triangles are no mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MeshError {
    /// A vertex is not finite.
    Vertex(usize),
    /// A triangle names a vertex that is not there.
    Triangle(usize),
    /// There is not one colour a triangle.
    Colours,
}

impl std::fmt::Display for MeshError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            MeshError::Vertex(vertex) => write!(f, "vertex {vertex} is not finite"),
            MeshError::Triangle(face) => write!(f, "face {face} names a vertex that is not there"),
            MeshError::Colours => write!(f, "there must be one colour a face"),
        }
    }
}

impl std::error::Error for MeshError {}

/// A corner, edge or face of it may be seen from both sides, unless it is closed.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Its triangles; a large mesh has several pieces, each of which is as coarse as its own distance allows.
    pub(crate) pieces: Vec<Piece>,
    /// Whether it has an inside and faces outwards, so that no triangle is seen from behind.
    pub(crate) closed: bool,
    /// Whether some face is translucent.
    pub(crate) translucent: bool,
}

/// Triangles of a mesh that lie together.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// From fine to coarse.
    pub levels: Vec<Level>,
    /// A ball around it, in the mesh's frame.
    pub centre: [f32; 3],
    pub radius: f32,
}

/// The triangles of a mesh, or of a coarser copy.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    /// How far a vertex may be from where it belongs, in the mesh's frame [m].
    pub error: f32,
    pub vertices: Vec<[f32; 3]>,
    pub faces: Vec<Face>,
}

#[derive(Clone, Debug)]
pub(crate) struct Face {
    pub corners: [u32; 3],
    /// Normal at each corner, parts in 32767ths.
    pub normals: [[i16; 3]; 3],
    /// Red, green, blue, opacity.
    pub colour: [u8; 4],
}

impl Mesh {
    /// Of vertices [m], triangles counter-clockwise as seen from outside, and a colour (red, green, blue, opacity) a
    /// triangle.
    ///
    /// # Errors
    /// A vertex is not finite, a triangle names one that is not there, or colours do not count up.
    pub fn new(
        vertices: &[[f32; 3]],
        triangles: &[[u32; 3]],
        colours: &[[u8; 4]],
    ) -> Result<Mesh, MeshError> {
        Mesh::shaded(vertices, triangles, colours, Shading::Smooth)
    }

    /// As [`Mesh::new`], shaded in this way.
    ///
    /// # Errors
    /// As [`Mesh::new`].
    pub fn shaded(
        vertices: &[[f32; 3]],
        triangles: &[[u32; 3]],
        colours: &[[u8; 4]],
        shading: Shading,
    ) -> Result<Mesh, MeshError> {
        if let Some(vertex) = vertices
            .iter()
            .position(|v| !v.iter().all(|part| part.is_finite()))
        {
            return Err(MeshError::Vertex(vertex));
        }
        if let Some(face) = triangles
            .iter()
            .position(|corners| corners.iter().any(|&v| v as usize >= vertices.len()))
        {
            return Err(MeshError::Triangle(face));
        }
        if colours.len() != triangles.len() {
            return Err(MeshError::Colours);
        }
        // vertices that lie in one place are one vertex: files often repeat them for each triangle
        let (welded, corners) = merged(vertices, triangles, |_, v| {
            v.map(|part| (part + 0.0).to_bits())
        });
        let closed = is_closed(&corners) && volume(&welded, &corners) > 0.0;
        let whole = Level::new(0.0, welded, &corners, colours, shading);
        Ok(Mesh {
            pieces: pieces(whole)
                .into_iter()
                .map(|(level, rim)| Piece::new(level, &rim, shading))
                .collect(),
            closed,
            translucent: colours.iter().any(|colour| colour[3] < 255),
        })
    }
}

impl Piece {
    /// With coarser copies, in which vertices of the rim stay: other pieces have them too, and no gap may open.
    fn new(finest: Level, rim: &[bool], shading: Shading) -> Piece {
        let [low, high] = extent(&finest.vertices);
        let centre: [f32; 3] = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let distance = |v: &[f32; 3]| (0..3).map(|k| (v[k] - centre[k]).powi(2)).sum::<f32>();
        let radius = finest
            .vertices
            .iter()
            .map(distance)
            .fold(0.0, f32::max)
            .sqrt();
        let side = (0..3)
            .map(|axis| high[axis] - low[axis])
            .fold(0.0, f32::max);
        let triangles: Vec<[u32; 3]> = finest.faces.iter().map(|face| face.corners).collect();
        let colours: Vec<[u8; 4]> = finest.faces.iter().map(|face| face.colour).collect();
        let mut levels = vec![finest];
        for cells in COARSER {
            let cell = side / cells;
            let last = &levels[levels.len() - 1];
            if cell <= 0.0 || last.faces.len() < 200 {
                break;
            }
            let places = |index: usize, v: &[f32; 3]| -> [u32; 3] {
                match rim[index] {
                    true => [u32::MAX, index as u32, 0],
                    false => std::array::from_fn(|axis| ((v[axis] - low[axis]) / cell) as u32),
                }
            };
            let (vertices, corners) = merged(&levels[0].vertices, &triangles, places);
            let count = corners.iter().filter(|corners| is_proper(corners)).count();
            if (count as f64) < WORTH * last.faces.len() as f64 {
                levels.push(Level::new(cell, vertices, &corners, &colours, shading));
            }
        }
        Piece {
            levels,
            centre,
            radius,
        }
    }

    /// The coarsest level whose error is below this [m].
    pub fn level(&self, error: f32) -> usize {
        let fine = self.levels[1..]
            .iter()
            .take_while(|level| level.error < error);
        fine.count()
    }
}

/// Triangles cut into pieces by the places of their middles, and which vertices of a piece others have too.
fn pieces(whole: Level) -> Vec<(Level, Vec<bool>)> {
    let count = whole.faces.len();
    if count <= WHOLE_MAX {
        let rim = vec![false; whole.vertices.len()];
        return vec![(whole, rim)];
    }
    let [low, high] = extent(&whole.vertices);
    let side = (0..3)
        .map(|axis| high[axis] - low[axis])
        .fold(0.0, f32::max);
    // as many along a side as a surface, not a solid, of this size needs
    let cell = side / (count as f32 / PIECE as f32).sqrt().ceil();
    let mut places: BTreeMap<[u32; 3], Vec<Face>> = BTreeMap::new();
    for face in whole.faces {
        let corners = face.corners.map(|vertex| whole.vertices[vertex as usize]);
        let place = std::array::from_fn(|axis| {
            let middle = corners.iter().map(|v| v[axis] - low[axis]).sum::<f32>() / 3.0;
            (middle / cell) as u32
        });
        places.entry(place).or_default().push(face);
    }
    // how many pieces have a vertex, and its number in the last one
    let mut owners = vec![0_u32; whole.vertices.len()];
    let mut numbers = vec![(u32::MAX, 0_u32); whole.vertices.len()];
    let mut cut = Vec::with_capacity(places.len());
    for (piece, mut faces) in places.into_values().enumerate() {
        let mut kept = Vec::new();
        for vertex in faces.iter_mut().flat_map(|face| &mut face.corners) {
            let number = &mut numbers[*vertex as usize];
            if number.0 != piece as u32 {
                *number = (piece as u32, kept.len() as u32);
                owners[*vertex as usize] += 1;
                kept.push(*vertex);
            }
            *vertex = number.1;
        }
        cut.push((faces, kept));
    }
    cut.into_iter()
        .map(|(faces, kept)| {
            let vertices = kept.iter().map(|&vertex| whole.vertices[vertex as usize]);
            let level = Level {
                error: 0.0,
                vertices: vertices.collect(),
                faces,
            };
            let rim = kept.iter().map(|&vertex| owners[vertex as usize] > 1);
            (level, rim.collect())
        })
        .collect()
}

impl Level {
    fn new(
        error: f32,
        vertices: Vec<[f32; 3]>,
        corners: &[[u32; 3]],
        colours: &[[u8; 4]],
        shading: Shading,
    ) -> Level {
        let (corners, colours): (Vec<_>, Vec<_>) = corners
            .iter()
            .zip(colours)
            .filter(|(corners, _)| is_proper(corners))
            .unzip();
        let corners: Vec<[u32; 3]> = corners;
        let wide: Vec<[f64; 3]> = vertices.iter().map(|v| v.map(f64::from)).collect();
        let normals = match shading {
            Shading::Smooth => corner_normals(&wide, &corners),
            Shading::Flat => facet_normals(&wide, &corners),
        };
        let faces = corners.into_iter().zip(normals).zip(colours);
        let faces = faces.map(|((corners, normals), colour)| Face {
            corners,
            normals,
            colour,
        });
        Level {
            error,
            faces: faces.collect(),
            vertices,
        }
    }
}

/// Whether its corners are three.
fn is_proper([a, b, c]: &[u32; 3]) -> bool {
    a != b && b != c && c != a
}

fn extent(vertices: &[[f32; 3]]) -> [[f32; 3]; 2] {
    let Some(&first) = vertices.first() else {
        return [[0.0; 3]; 2];
    };
    vertices.iter().fold([first; 2], |[low, high], v| {
        [
            std::array::from_fn(|axis| low[axis].min(v[axis])),
            std::array::from_fn(|axis| high[axis].max(v[axis])),
        ]
    })
}

/// Vertices of one place become one, at their mean; triangles with the numbers of these.
fn merged(
    vertices: &[[f32; 3]],
    triangles: &[[u32; 3]],
    place: impl Fn(usize, &[f32; 3]) -> [u32; 3],
) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::with_capacity(vertices.len());
    let mut sums: Vec<([f64; 3], f64)> = Vec::new();
    let number: Vec<u32> = vertices
        .iter()
        .enumerate()
        .map(|(index, vertex)| {
            let number = *numbers.entry(place(index, vertex)).or_insert_with(|| {
                sums.push(([0.0; 3], 0.0));
                sums.len() as u32 - 1
            });
            let (sum, count) = &mut sums[number as usize];
            for axis in 0..3 {
                sum[axis] += f64::from(vertex[axis]);
            }
            *count += 1.0;
            number
        })
        .collect();
    let means = sums
        .into_iter()
        .map(|(sum, count)| sum.map(|part| (part / count) as f32))
        .collect();
    let corners = triangles
        .iter()
        .map(|corners| corners.map(|vertex| number[vertex as usize]))
        .collect();
    (means, corners)
}

/// What closed triangles that face outwards enclose, as tetrahedra from the first vertex; negative where they face inwards.
fn volume(vertices: &[[f32; 3]], corners: &[[u32; 3]]) -> f64 {
    let Some(origin) = vertices.first() else {
        return 0.0;
    };
    let from_origin = |vertex: u32| {
        let vertex = vertices[vertex as usize];
        std::array::from_fn(|axis| f64::from(vertex[axis]) - f64::from(origin[axis]))
    };
    let tetrahedra = corners.iter().map(|corners| {
        let [a, b, c] = corners.map(from_origin);
        dot(a, cross(b, c)) / 6.0
    });
    tetrahedra.sum()
}

/// Whether each edge belongs to two triangles, which run along it in opposite directions.
fn is_closed(corners: &[[u32; 3]]) -> bool {
    // the ends of an edge, the lower first, and whether it is run along from there
    let mut edges: Vec<(u32, u32, bool)> = Vec::with_capacity(3 * corners.len());
    for &[a, b, c] in corners.iter().filter(|corners| is_proper(corners)) {
        let sides = [(a, b), (b, c), (c, a)];
        edges.extend(sides.map(|(from, to)| (from.min(to), from.max(to), from < to)));
    }
    edges.sort_unstable();
    let (pairs, rest) = edges.as_chunks::<2>();
    let is_pair = |&[first, other]: &[(u32, u32, bool); 2]| {
        (first.0, first.1) == (other.0, other.1) && first.2 != other.2
    };
    !pairs.is_empty() && rest.is_empty() && pairs.iter().all(is_pair)
}
