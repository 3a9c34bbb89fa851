//! Convex hulls by quickhull (Barber, Dobkin and Huhdanpaa 1996) on exact predicates, the farthest point first.
//!
//! Whether a point sees a facet is decided exactly (Shewchuk 1997), so that what is visible is always one patch and any
//! finite points that are not flat have a closed, convex hull: coplanar, doubled and nearly equal points included. As the
//! farthest point comes first, stopping early leaves the best few vertices that a greedy choice can find. So this makes the
//! hulls of fewer vertices than the points ask for, and those that parry3d fails at (`super::parry::hull`).

use robust::{Coord3D, orient3d};

use super::vector::{Vector, area_vector, cross, dot, norm, size, sub, unit};

/// Extent across the others below which points count as one place, a line or a flat sheet, relative to the largest.
const FLAT: f64 = 1e-7;
/// Coordinates below this are 0, or the exact predicate's products would underflow [m].
const UNDERFLOW: f64 = 1e-60;

/// Why points have no hull with a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NoHull {
    /// All at one place, or on a line.
    Thin,
    /// In one plane.
    Flat {
        /// Its unit normal [–].
        normal: Vector,
    },
}

struct Facet {
    corners: [u32; 3],
    /// The facet across the edge from each corner to the next.
    across: [usize; 3],
    normal: Vector,
    /// Points that see this facet, not yet in the hull.
    outside: Vec<u32>,
    /// Height of the farthest of them, and its place in the list.
    farthest: (f64, usize),
    alive: bool,
}

/// Triangles of the hull of points, counter-clockwise from outside, as indices of the points; with at most `vertices_max` vertices; points nearer than `tolerance` [m] to it are left out.
///
/// # Errors
/// Points without extent in all three directions.
pub(super) fn quickhull(
    points: &[Vector],
    vertices_max: usize,
    tolerance: f64,
) -> Result<Vec<[u32; 3]>, NoHull> {
    let points: Vec<Vector> = points
        .iter()
        .map(|point| point.map(|x| if x.abs() < UNDERFLOW { 0.0 } else { x }))
        .collect();
    let mut hull = Builder::new(&points)?;
    let mut vertices = 4;
    while vertices < vertices_max.max(4) {
        let Some((facet, height)) = hull.farthest() else {
            break;
        };
        if height <= tolerance {
            break;
        }
        hull.add(facet);
        vertices += 1;
    }
    Ok(hull.finish())
}

struct Builder<'a> {
    points: &'a [Vector],
    facets: Vec<Facet>,
    free: Vec<usize>,
    /// Facets that the newest point sees, and those seen from inside them over the horizon.
    visible: Vec<usize>,
    /// Edges around them: start, end, and the facet beyond.
    horizon: Vec<(u32, u32, usize)>,
}

impl<'a> Builder<'a> {
    /// A tetrahedron of points far apart; all others see one of its facets or lie inside.
    fn new(points: &'a [Vector]) -> Result<Builder<'a>, NoHull> {
        let mut corners = simplex(points)?;
        if sees(points, [corners[0], corners[1], corners[2]], corners[3]) {
            corners.swap(1, 2);
        }
        let [a, b, c, d] = corners;
        // the fourth corner lies below the first facet; each edge is shared with the facet named beside it
        let facets = [
            ([a, b, c], [1, 2, 3]),
            ([a, d, b], [3, 2, 0]),
            ([b, d, c], [1, 3, 0]),
            ([c, d, a], [2, 1, 0]),
        ];
        let mut builder = Builder {
            points,
            facets: Vec::new(),
            free: Vec::new(),
            visible: Vec::new(),
            horizon: Vec::new(),
        };
        for (corners, across) in facets {
            builder.push(corners, across);
        }
        let all = (0..points.len() as u32).filter(|point| !corners.contains(point));
        builder.share_out(all, &[0, 1, 2, 3]);
        Ok(builder)
    }

    fn push(&mut self, corners: [u32; 3], across: [usize; 3]) -> usize {
        let places = corners.map(|corner| self.points[corner as usize]);
        let facet = Facet {
            corners,
            across,
            normal: unit(area_vector(places)),
            outside: Vec::new(),
            farthest: (0.0, 0),
            alive: true,
        };
        match self.free.pop() {
            Some(slot) => {
                self.facets[slot] = facet;
                slot
            }
            None => {
                self.facets.push(facet);
                self.facets.len() - 1
            }
        }
    }

    /// Gives each point to that facet of these which it is highest above, so that the farthest point is not overlooked.
    fn share_out(&mut self, points: impl Iterator<Item = u32>, facets: &[usize]) {
        for point in points {
            let seen = facets
                .iter()
                .filter(|&&facet| sees(self.points, self.facets[facet].corners, point))
                .map(|&facet| (facet, self.height(facet, point)));
            if let Some((facet, height)) = seen.max_by(|a, b| a.1.total_cmp(&b.1)) {
                let facet = &mut self.facets[facet];
                if facet.outside.is_empty() || height > facet.farthest.0 {
                    facet.farthest = (height, facet.outside.len());
                }
                facet.outside.push(point);
            }
        }
    }

    fn height(&self, facet: usize, point: u32) -> f64 {
        let facet = &self.facets[facet];
        let base = self.points[facet.corners[0] as usize];
        dot(facet.normal, sub(self.points[point as usize], base))
    }

    /// The facet with the farthest point outside, and that point's height.
    fn farthest(&self) -> Option<(usize, f64)> {
        let with_points = self
            .facets
            .iter()
            .enumerate()
            .filter(|(_, facet)| facet.alive && !facet.outside.is_empty());
        with_points
            .map(|(index, facet)| (index, facet.farthest.0))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Takes the farthest point of a facet into the hull: what it sees goes, a cone from the horizon to it comes.
    fn add(&mut self, facet: usize) {
        let apex = self.facets[facet].outside[self.facets[facet].farthest.1];
        self.look(facet, apex);
        let mut orphans = Vec::new();
        for index in std::mem::take(&mut self.visible) {
            let facet = &mut self.facets[index];
            orphans.append(&mut facet.outside);
            self.free.push(index);
        }
        let horizon = std::mem::take(&mut self.horizon);
        let cone: Vec<usize> = horizon
            .iter()
            .map(|&(from, to, beyond)| self.push([from, to, apex], [beyond, 0, 0]))
            .collect();
        // each corner of the horizon begins one edge and ends another
        let mut begins: Vec<(u32, usize)> = horizon
            .iter()
            .zip(&cone)
            .map(|(edge, &facet)| (edge.0, facet))
            .collect();
        begins.sort_unstable();
        for (&(from, to, beyond), &facet) in horizon.iter().zip(&cone) {
            let at = begins.binary_search_by_key(&to, |&(corner, _)| corner);
            let next = begins[at.expect("the horizon of an exact hull is one closed loop")].1;
            self.facets[facet].across[1] = next;
            self.facets[next].across[2] = facet;
            let back = self.facets[beyond]
                .corners
                .iter()
                .position(|&corner| corner == to);
            let back = back.expect("the facet beyond an edge runs along it the other way");
            debug_assert_eq!(self.facets[beyond].corners[(back + 1) % 3], from);
            self.facets[beyond].across[back] = facet;
        }
        self.share_out(orphans.into_iter().filter(|&point| point != apex), &cone);
    }

    /// Collects the facets that a point sees, from one of them outward, and their horizon.
    fn look(&mut self, first: usize, apex: u32) {
        self.visible.clear();
        self.horizon.clear();
        self.facets[first].alive = false;
        self.visible.push(first);
        let mut next = 0;
        while next < self.visible.len() {
            let (corners, across) = (
                self.facets[self.visible[next]].corners,
                self.facets[self.visible[next]].across,
            );
            next += 1;
            for edge in 0..3 {
                let beyond = across[edge];
                if !self.facets[beyond].alive {
                    continue;
                }
                if sees(self.points, self.facets[beyond].corners, apex) {
                    self.facets[beyond].alive = false;
                    self.visible.push(beyond);
                } else {
                    self.horizon
                        .push((corners[edge], corners[(edge + 1) % 3], beyond));
                }
            }
        }
    }

    fn finish(self) -> Vec<[u32; 3]> {
        let alive = self.facets.into_iter().filter(|facet| facet.alive);
        alive.map(|facet| facet.corners).collect()
    }
}

/// Whether a point lies strictly above the plane of a triangle, exactly.
fn sees(points: &[Vector], triangle: [u32; 3], point: u32) -> bool {
    let place = |index: u32| {
        let [x, y, z] = points[index as usize];
        Coord3D { x, y, z }
    };
    let [a, b, c] = triangle.map(place);
    orient3d(a, b, c, place(point)) < 0.0
}

/// Four points far apart: the ends of the longest axis, then the farthest from their line, then from that plane.
pub(super) fn simplex(points: &[Vector]) -> Result<[u32; 4], NoHull> {
    let least = FLAT * size(points);
    let farthest = |measure: &dyn Fn(Vector) -> f64| {
        let values = points.iter().map(|&point| measure(point)).enumerate();
        values
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 0.0))
    };
    let mut ends = [(0, 0.0), (0, 0.0)];
    for axis in 0..3 {
        let (low, _) = farthest(&|point| -point[axis]);
        let (high, _) = farthest(&|point| point[axis]);
        if let (Some(a), Some(b)) = (points.get(low), points.get(high))
            && norm(sub(*b, *a)) > ends[1].1
        {
            ends = [(low, 0.0), (high, norm(sub(*b, *a)))];
        }
    }
    if ends[1].1 <= least || least == 0.0 {
        return Err(NoHull::Thin);
    }
    let (a, b) = (points[ends[0].0], points[ends[1].0]);
    let along = unit(sub(b, a));
    let (third, width) = farthest(&|point| norm(cross(along, sub(point, a))));
    if width <= least {
        return Err(NoHull::Thin);
    }
    let normal = unit(area_vector([a, b, points[third]]));
    let (fourth, height) = farthest(&|point| dot(normal, sub(point, a)).abs());
    if height <= least {
        return Err(NoHull::Flat { normal });
    }
    Ok([ends[0].0, ends[1].0, third, fourth].map(|index| index as u32))
}
