//! Faces and edges of a shape at the corners where it touches another.

use super::clip::Polygon;
use super::gjk::Simplex;
use super::solid::{Form, Solid};
use super::vector::{Point, along, dot, scale, sub, unit};
use crate::constants::hull::reference::AROUND_MAX;
use arrayvec::ArrayVec;

/// Two faces touch where the cosine of their normals is below this, negative: up to 5.1° (MuJoCo: `mjFACE_TOL`).
pub const FACES_ALIGNED: f64 = 0.996;

/// Cosines of the corners of a cylinder's cap, with MuJoCo's digits: these decide which of equal areas is the largest.
#[expect(clippy::approx_constant, reason = "MuJoCo's digits")]
const COSINES: [f64; 16] = [
    1.0,
    0.923_879_532_511_287,
    0.707_106_781_186_548,
    0.382_683_432_365_090,
    0.0,
    -0.382_683_432_365_090,
    -0.707_106_781_186_547,
    -0.923_879_532_511_287,
    -1.0,
    -0.923_879_532_511_287,
    -0.707_106_781_186_548,
    -0.382_683_432_365_090,
    0.0,
    0.382_683_432_365_090,
    0.707_106_781_186_547,
    0.923_879_532_511_287,
];

/// Their sines.
#[expect(clippy::approx_constant, reason = "MuJoCo's digits")]
const SINES: [f64; 16] = [
    0.0,
    0.382_683_432_365_090,
    0.707_106_781_186_547,
    0.923_879_532_511_287,
    1.0,
    0.923_879_532_511_287,
    0.707_106_781_186_548,
    0.382_683_432_365_090,
    0.0,
    -0.382_683_432_365_090,
    -0.707_106_781_186_547,
    -0.923_879_532_511_287,
    -1.0,
    -0.923_879_532_511_287,
    -0.707_106_781_186_548,
    -0.382_683_432_365_090,
];

/// Signs of the corners of each side of a box, clockwise from outside. Side 2 k is at the positive end of axis k.
const BOX_SIDES: [[[f64; 3]; 4]; 6] = [
    [[1., 1., 1.], [1., 1., -1.], [1., -1., -1.], [1., -1., 1.]],
    [
        [-1., 1., -1.],
        [-1., 1., 1.],
        [-1., -1., 1.],
        [-1., -1., -1.],
    ],
    [[-1., 1., -1.], [1., 1., -1.], [1., 1., 1.], [-1., 1., 1.]],
    [
        [-1., -1., 1.],
        [1., -1., 1.],
        [1., -1., -1.],
        [-1., -1., -1.],
    ],
    [[-1., 1., 1.], [1., 1., 1.], [1., -1., 1.], [-1., -1., 1.]],
    [
        [1., 1., -1.],
        [-1., 1., -1.],
        [-1., -1., -1.],
        [1., -1., -1.],
    ],
];

/// Sides of a shape by their outward normals [–].
pub type Sides = ArrayVec<(Point, u32), AROUND_MAX>;
/// Edges of a shape by their directions [–] and ends [m].
pub type Edges = ArrayVec<(Point, [Point; 2]), AROUND_MAX>;

/// The corners of a shape that the nearest face of the Minkowski difference comes from, each once.
pub struct Touching {
    pub count: usize,
    corners: [u32; 3],
    points: [Point; 3],
}

impl Touching {
    /// Those of the first or second shape.
    pub fn new(simplex: &Simplex, which: usize) -> Touching {
        // fewer than three repeat the first
        let vertex = |k: usize| simplex.get(k).unwrap_or(&simplex[0]);
        let mut corners = [0, 1, 2].map(|k| vertex(k).corners[which]);
        let mut points = [0, 1, 2].map(|k| vertex(k).on[which]);
        // two equal corners stand first and third, so that the first two differ
        let [a, b, c] = corners;
        let count = match (a == b, a == c) {
            (true, true) => 1,
            (true, false) => {
                (corners[1], points[1]) = (c, points[2]);
                2
            }
            (false, is_first) => 3 - usize::from(is_first || b == c),
        };
        Touching {
            count,
            corners,
            points,
        }
    }

    fn corners(&self) -> &[u32] {
        &self.corners[..self.count]
    }
}

impl Solid<'_> {
    /// The sides that all touching corners belong to; of a box that has none, the one that faces along a direction.
    pub fn sides(&self, touching: &Touching, toward: Point) -> Sides {
        match self.form {
            Form::Box => {
                let sides = self.sides_of_box(touching);
                // corners on a diagonal have fewer sides in common
                match sides.len() + touching.count == 4 {
                    true => sides,
                    false => self.side_of_box_along(toward),
                }
            }
            Form::Mesh(hull) => {
                let sides = hull.sides(touching.corners());
                let normal = |side: u32| self.turned(hull.normals[side as usize]);
                sides.map(|side| (normal(side), side)).collect()
            }
            // a cap that touches in one point; each cap is a corner
            Form::Cylinder if touching.count == 1 => {
                let cap = touching.corners[0];
                let z = if cap == 0 { 1.0 } else { -1.0 };
                [(self.turned([0.0, 0.0, z]), cap)].into_iter().collect()
            }
            _ => Sides::new(),
        }
    }

    fn sides_of_box(&self, touching: &Touching) -> Sides {
        let mut sides = Sides::new();
        for axis in 0..3 {
            // a side has them all if they have one sign along its axis
            let signs = touching.corners().iter().map(|corner| corner >> axis & 1);
            let positive = signs.sum::<u32>() as usize;
            if positive == touching.count || positive == 0 {
                sides.push(self.side_of_box(axis, positive == 0));
            }
        }
        sides
    }

    fn side_of_box_along(&self, toward: Point) -> Sides {
        // the axis that the direction is nearest to
        let local = self.local(toward);
        let local = scale(local, 1.0 / dot(local, local).sqrt());
        for (axis, cosine) in local.into_iter().enumerate() {
            if cosine.abs() > FACES_ALIGNED {
                return [self.side_of_box(axis, cosine < 0.0)].into_iter().collect();
            }
        }
        Sides::new()
    }

    fn side_of_box(&self, axis: usize, is_negative: bool) -> (Point, u32) {
        let mut normal = [0.0; 3];
        normal[axis] = if is_negative { -1.0 } else { 1.0 };
        (
            self.turned(normal),
            (2 * axis) as u32 + u32::from(is_negative),
        )
    }

    /// The edge between two touching corners, or those that begin at the only one. A capsule's passes `beside` its axis.
    pub fn edges(&self, touching: &Touching, beside: Point) -> Edges {
        let [start, end, _] = touching.points;
        let corner = touching.corners[0];
        let to = |end: Point| (unit(sub(end, start)), [start, end]);
        let mut edges = Edges::new();
        match self.form {
            Form::Box | Form::Mesh(_) if touching.count == 2 => edges.push(to(end)),
            Form::Box => {
                // the three corners that differ in one sign
                let sign = |k: usize| if corner >> k & 1 == 1 { 1.0 } else { -1.0 };
                for axis in 0..3 {
                    let mut local = [0, 1, 2].map(|k| sign(k) * self.size[k]);
                    local[axis] = -local[axis];
                    edges.push(to(self.placed(local)));
                }
            }
            Form::Mesh(hull) => {
                let corners = hull.corners_before(corner);
                edges.extend(corners.map(|k| to(self.placed(hull.vertices[k as usize]))));
            }
            // along its axis, from the end that touches to the other
            Form::Cylinder => {
                let axis = scale(self.axes[2], if corner == 0 { -1.0 } else { 1.0 });
                edges.push((axis, [start, along(start, axis, 2.0 * self.size[1])]));
            }
            // from end to end of its axis, moved to the place beside it
            Form::Capsule => {
                let [x, y, _] = self.local(sub(beside, self.center));
                let half = self.size[1];
                edges.push((self.axes[2], [-half, half].map(|z| self.placed([x, y, z]))));
            }
            _ => {}
        }
        edges
    }

    /// The corners of a side, clockwise from outside.
    pub fn face(&self, side: u32) -> Polygon {
        match self.form {
            Form::Box => {
                let corners = BOX_SIDES[side as usize].iter();
                let corner = |signs: &Point| [0, 1, 2].map(|k| signs[k] * self.size[k]);
                corners.map(|signs| self.placed(corner(signs))).collect()
            }
            Form::Mesh(hull) => {
                // the tables have them counter-clockwise
                let corners = hull.faces[side as usize].iter().rev();
                corners
                    .map(|&k| self.placed(hull.vertices[k as usize]))
                    .collect()
            }
            _ => {
                // a cap as a polygon
                let [radius, half, _] = self.size;
                let sign = if side == 0 { 1.0 } else { -1.0 };
                let corner =
                    |k: usize| [COSINES[k] * radius, -SINES[k] * radius * sign, sign * half];
                (0..COSINES.len()).map(|k| self.placed(corner(k))).collect()
            }
        }
    }
}
