//! Convex polyhedra for contacts: few vertices, and faces that are polygons rather than triangles.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::polytope::triangles_around_stretched;
use super::stretch::{NoHull, stretched};
use super::vector::{
    Vector, add, area_vector, dot, extent, longest, norm, scale, six_volumes, size, sub, unit,
};

/// How far corners may be off a face's plane, relative to the hull's size: far above roundings of f32 files. A thin hull is
/// measured stretched.
const COPLANAR: f64 = 1e-5;
/// Largest coordinate [m]: its cube, a volume, is still far from the largest number.
const COORDINATE_MAX: f64 = 1e100;
/// Thickness of the plate that stands for a flat mesh, relative to its size.
const PLATE: f64 = 1e-3;

/// A convex polyhedron.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hull {
    /// Corners, each one of the points it was made of. `(vertices, 3)` [m]
    pub vertices: Vec<[f64; 3]>,
    /// Polygons around it.
    pub faces: Vec<Face>,
    /// Where two faces meet.
    pub edges: Vec<Edge>,
    /// Polygons around it as MuJoCo made them, which rest on planes; `faces` do where there are none.
    pub polygons: Vec<Polygon>,
    /// MuJoCo's hull, where this one has fewer vertices.
    #[serde(skip)]
    pub whole: Option<Arc<WholeHull>>,
    /// Largest height above the faces of a point that was left out [m].
    pub error: f64,
    /// Whether it is a plate that stands for points in a plane.
    pub flat: bool,
}

/// A hull as MuJoCo made it, with more vertices than tables are to have.
#[derive(Clone, Debug, PartialEq)]
pub struct WholeHull {
    /// Corners in the order in which equally deep ones count. `(vertices, 3)` [m]
    pub vertices: Vec<[f64; 3]>,
    /// Polygons around it.
    pub polygons: Vec<Polygon>,
}

/// A side of a hull.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// Indices of its corners, counter-clockwise from outside.
    pub corners: Vec<u32>,
    /// Unit normal, outward [–].
    pub normal: [f64; 3],
    /// Its plane is where normal · x is this [m].
    pub offset: f64,
}

/// A side of a hull without its place: MuJoCo's joins neighbours that differ more than those of a [`Face`], or less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// Indices of its corners, counter-clockwise from outside.
    pub corners: Vec<u32>,
    /// Unit normal, outward [–].
    pub normal: [f64; 3],
}

/// Where two faces of a hull meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Edge {
    /// Indices of its ends; the first face runs from the first to the second, the second face back.
    pub ends: [u32; 2],
    /// Indices of the faces beside it.
    pub faces: [u32; 2],
}

impl Hull {
    /// The hull of points, with at most `vertices_max` corners (at least 8 where it is to be a good one).
    ///
    /// The farthest points become corners first. Points in one plane get a plate as thick as a thousandth of their size.
    ///
    /// # Errors
    /// Points that are on a line or not finite, and hulls that rounding spoils.
    pub fn from_points(points: &[[f64; 3]], vertices_max: usize) -> Result<Hull, NoHull> {
        if !points.iter().flatten().all(|x| x.abs() <= COORDINATE_MAX) {
            return Err(NoHull::Thin);
        }
        let mut hull = match Hull::around(points, vertices_max) {
            Err(NoHull::Flat { normal }) => {
                let half = scale(normal, 0.5 * PLATE * size(points));
                let both = points
                    .iter()
                    .flat_map(|&point| [add(point, half), sub(point, half)]);
                let plate: Vec<Vector> = both.collect();
                Hull {
                    flat: true,
                    ..Hull::around(&plate, vertices_max)?
                }
            }
            whole => whole?,
        };
        hull.error = hull.height(points);
        Ok(hull)
    }

    fn around(points: &[Vector], vertices_max: usize) -> Result<Hull, NoHull> {
        // where the hull is thin, its corners and faces are found among stretched points, so that its sides are no slivers
        let stretched = stretched(points)?;
        let triangles = triangles_around_stretched(&stretched, vertices_max)?;
        let slack = COPLANAR * size(&stretched.points);
        let outlines = outlines(&stretched.points, &triangles, slack);
        Ok(Hull::new(points, outlines))
    }

    /// Largest height of a point above the faces' planes; 0 if all lie inside.
    fn height(&self, points: &[Vector]) -> f64 {
        // from the middle, far from the origin nothing is lost
        let (centre, _) = self.bounding_sphere();
        let mut height: f64 = 0.0;
        for face in &self.faces {
            let offset = face.offset - dot(face.normal, centre);
            for &point in points {
                height = height.max(dot(face.normal, sub(point, centre)) - offset);
            }
        }
        height
    }

    /// Its vertices, or those of the whole hull.
    fn outermost(&self) -> &[[f64; 3]] {
        let whole = self.whole.as_ref().map(|whole| &whole.vertices);
        whole.unwrap_or(&self.vertices)
    }

    /// Its sides by their corners and outward normals: those that MuJoCo made, or its own faces where there are none.
    pub fn sides(&self) -> impl Iterator<Item = (&[u32], [f64; 3])> {
        let faces = self.faces.iter().filter(|_| self.polygons.is_empty());
        let faces = faces.map(|face| (&face.corners[..], face.normal));
        let polygons = self.polygons.iter();
        let polygons = polygons.map(|side| (&side.corners[..], side.normal));
        polygons.chain(faces)
    }

    /// Centre and radius of a ball around it, with the whole hull [m].
    pub fn bounding_sphere(&self) -> ([f64; 3], f64) {
        let [low, high] = self.extent();
        let centre = scale(add(low, high), 0.5);
        let radius = self
            .outermost()
            .iter()
            .map(|&vertex| norm(sub(vertex, centre)))
            .fold(0.0, f64::max);
        (centre, radius)
    }

    /// Lowest and highest coordinates, with the whole hull [m].
    pub fn extent(&self) -> [[f64; 3]; 2] {
        extent(self.outermost())
    }

    /// Its volume [m³].
    pub fn volume(&self) -> f64 {
        let Some(&origin) = self.vertices.first() else {
            return 0.0;
        };
        let corner = |index: u32| self.vertices[index as usize];
        let mut volume = 0.0;
        for face in &self.faces {
            for pair in face.corners[1..].windows(2) {
                let triangle = [face.corners[0], pair[0], pair[1]].map(corner);
                volume += six_volumes(origin, triangle) / 6.0;
            }
        }
        volume
    }

    /// The same hull with these vertices, in their order, and these polygons to rest on.
    ///
    /// All of its own vertices are among them; the others lie on it or inside, up to a rounding. A plate that stands for points
    /// in a plane has vertices of its own, and stays as it is.
    pub fn with_polygons(mut self, vertices: Vec<[f64; 3]>, polygons: Vec<Polygon>) -> Hull {
        let place = |vertex: [f64; 3]| vertices.iter().position(|&other| other == vertex);
        let places: Option<Vec<usize>> =
            self.vertices.iter().map(|&vertex| place(vertex)).collect();
        let Some(places) = places else {
            return self;
        };
        let renamed = |corner: u32| places[corner as usize] as u32;
        for face in &mut self.faces {
            face.corners
                .iter_mut()
                .for_each(|corner| *corner = renamed(*corner));
        }
        for edge in &mut self.edges {
            edge.ends = edge.ends.map(renamed);
        }
        Hull {
            vertices,
            polygons,
            ..self
        }
    }

    /// The hull whose faces have these outlines.
    fn new(points: &[Vector], outlines: Vec<Vec<u32>>) -> Hull {
        let mut renamed = vec![u32::MAX; points.len()];
        let mut hull = Hull::default();
        for outline in outlines {
            let corners: Vec<u32> = outline
                .into_iter()
                .map(|corner| {
                    let new = &mut renamed[corner as usize];
                    if *new == u32::MAX {
                        *new = hull.vertices.len() as u32;
                        hull.vertices.push(points[corner as usize]);
                    }
                    *new
                })
                .collect();
            let places: Vec<Vector> = corners
                .iter()
                .map(|&corner| hull.vertices[corner as usize])
                .collect();
            let normal = normal_of(&places);
            let offset =
                places.iter().map(|&place| dot(normal, place)).sum::<f64>() / places.len() as f64;
            hull.faces.push(Face {
                corners,
                normal,
                offset,
            });
        }
        hull.edges = edges(&hull.faces);
        hull
    }
}

/// Normal of a polygon, by the sum of its triangles' areas.
fn normal_of(places: &[Vector]) -> Vector {
    let mut sum = [0.0; 3];
    for pair in places[1..].windows(2) {
        sum = add(sum, area_vector([places[0], pair[0], pair[1]]));
    }
    unit(sum)
}

/// Outlines of the faces that triangles of a convex surface make together.
fn outlines(points: &[Vector], triangles: &[[u32; 3]], flat: f64) -> Vec<Vec<u32>> {
    let places = |triangle: usize| triangles[triangle].map(|corner| points[corner as usize]);
    let mut beside: Vec<((u32, u32), usize)> = triangles
        .iter()
        .enumerate()
        .flat_map(|(index, &[a, b, c])| [((a, b), index), ((b, c), index), ((c, a), index)])
        .collect();
    beside.sort_unstable();
    let across = |from: u32, to: u32| {
        let at = beside.binary_search_by_key(&(to, from), |entry| entry.0);
        beside[at.expect("a hull is closed")].1
    };

    // large triangles have the best normals, so they lead
    let mut order: Vec<usize> = (0..triangles.len()).collect();
    order.sort_by(|&a, &b| {
        let area = |index| norm(area_vector(places(index)));
        area(b).total_cmp(&area(a)).then(a.cmp(&b))
    });
    const NONE: usize = usize::MAX;
    let mut group_of = vec![NONE; triangles.len()];
    let mut faces: Vec<Vec<u32>> = Vec::new();
    for seed in order {
        if group_of[seed] != NONE {
            continue;
        }
        let group = faces.len();
        let normal = unit(area_vector(places(seed)));
        let base = places(seed)[0];
        let mut members = vec![seed];
        group_of[seed] = group;
        let mut next = 0;
        while next < members.len() {
            let [a, b, c] = triangles[members[next]];
            next += 1;
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let other = across(from, to);
                let near = |place: &Vector| dot(normal, sub(*place, base)).abs() <= flat;
                // what stands across does not belong; but a sliver as thin as the slack has no normal to speak of
                let area = area_vector(places(other));
                let along = dot(normal, area) >= 0.0 || norm(area) <= flat * longest(places(other));
                if group_of[other] == NONE && along && places(other).iter().all(near) {
                    group_of[other] = group;
                    members.push(other);
                }
            }
        }
        let rim: Vec<(u32, u32)> = members
            .iter()
            .flat_map(|&member| {
                let [a, b, c] = triangles[member];
                [(a, b), (b, c), (c, a)]
            })
            .filter(|&(from, to)| group_of[across(from, to)] != group)
            .collect();
        match closed_loop(&rim) {
            Some(outline) => faces.push(outline),
            None => {
                // no simple polygon: the leader stays alone, the others look for another face
                members[1..]
                    .iter()
                    .for_each(|&member| group_of[member] = NONE);
                faces.push(triangles[seed].to_vec());
            }
        }
    }
    drop_straight(&mut faces, points.len());
    faces
}

/// The corners of edges that make one loop, in its order.
fn closed_loop(edges: &[(u32, u32)]) -> Option<Vec<u32>> {
    let mut sorted = edges.to_vec();
    sorted.sort_unstable();
    if sorted.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return None; // touches itself
    }
    let first = sorted.first()?.0;
    let mut corners = vec![first];
    loop {
        let at = sorted
            .binary_search_by_key(corners.last()?, |edge| edge.0)
            .ok()?;
        let next = sorted[at].1;
        if next == first {
            return (corners.len() == sorted.len() && corners.len() >= 3).then_some(corners);
        }
        if corners.len() == sorted.len() {
            return None;
        }
        corners.push(next);
    }
}

/// Leaves out corners that lie between two faces only: they are on the straight edge between these.
fn drop_straight(faces: &mut [Vec<u32>], points: usize) {
    let mut faces_at = vec![0_u32; points];
    for corner in faces.iter().flatten() {
        faces_at[*corner as usize] += 1;
    }
    // a face needs three corners that stay
    let needed: Vec<u32> = faces
        .iter()
        .filter(|face| {
            face.iter()
                .filter(|&&corner| faces_at[corner as usize] > 2)
                .count()
                < 3
        })
        .flatten()
        .copied()
        .collect();
    for corner in needed {
        faces_at[corner as usize] = faces_at[corner as usize].max(3);
    }
    for face in faces {
        face.retain(|&corner| faces_at[corner as usize] > 2);
    }
}

/// Pairs of faces that run along the same two corners.
fn edges(faces: &[Face]) -> Vec<Edge> {
    let mut ways: Vec<([u32; 2], u32)> = Vec::new();
    for (index, face) in faces.iter().enumerate() {
        for (place, &from) in face.corners.iter().enumerate() {
            let to = face.corners[(place + 1) % face.corners.len()];
            ways.push(([from, to], index as u32));
        }
    }
    ways.sort_unstable();
    ways.iter()
        .filter(|([from, to], _)| from < to)
        .filter_map(|&([from, to], face)| {
            let back = ways.binary_search_by_key(&[to, from], |way| way.0).ok()?;
            Some(Edge {
                ends: [from, to],
                faces: [face, ways[back].1],
            })
        })
        .collect()
}
