//! Shapes of a pair, and their support functions (MuJoCo: `engine_collision_convex.c`).

use super::vector::{Point, TINY, add, along, dot, scale, sub};
use crate::constants::hull::reference::ReferenceHull;

/// What a shape is.
#[derive(Clone, Copy, Debug)]
pub enum Form<'a> {
    Sphere,
    Capsule,
    Ellipsoid,
    Cylinder,
    Box,
    Mesh(&'a ReferenceHull),
    /// A prism of a height field in the frame of the pair: three corners below, then those above them. All are one corner, so
    /// that a search against a polytope may end early, as MuJoCo's does.
    Prism([Point; 6]),
    /// The centre of a sphere.
    Center,
    /// The axis of a capsule.
    Axis,
}

/// A shape of a pair.
#[derive(Clone, Copy, Debug)]
pub struct Solid<'a> {
    pub form: Form<'a>,
    /// As MuJoCo's `geom_size` [m].
    pub size: Point,
    /// As `geom_xpos`, in any frame [m].
    pub center: Point,
    /// Its axes, by columns [–].
    pub axes: [Point; 3],
}

impl Solid<'static> {
    /// The prism below a triangle.
    pub fn prism(top: [Point; 3], bottom: f64) -> Self {
        let [a, b, c] = top;
        let [d, e, f] = top.map(|[x, y, _]| [x, y, bottom]);
        let sum = [e, f, a, b, c].into_iter().fold(d, add);
        Solid {
            form: Form::Prism([d, e, f, a, b, c]),
            size: [0.0; 3],
            center: scale(sum, 1.0 / 6.0),
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        }
    }
}

impl<'a> Solid<'a> {
    /// A point of its frame.
    pub fn placed(&self, local: Point) -> Point {
        add(self.turned(local), self.center)
    }

    /// A direction of its frame.
    pub fn turned(&self, [x, y, z]: Point) -> Point {
        let [a, b, c] = self.axes;
        add(add(scale(a, x), scale(b, y)), scale(c, z))
    }

    /// A direction, in its frame.
    pub fn local(&self, direction: Point) -> Point {
        self.axes.map(|axis| dot(axis, direction))
    }

    /// Is it a polytope, of which a search ends after finitely many steps?
    fn is_discrete(&self) -> bool {
        matches!(self.form, Form::Box | Form::Mesh(_) | Form::Prism(_))
    }

    /// May it touch in more than a point?
    pub fn has_faces(&self) -> bool {
        !matches!(self.form, Form::Sphere | Form::Ellipsoid | Form::Prism(_))
    }

    /// Radius and core of a sphere or capsule; none of other shapes.
    pub fn core(&self) -> Option<(f64, Solid<'a>)> {
        let form = match self.form {
            Form::Sphere => Form::Center,
            Form::Capsule => Form::Axis,
            _ => return None,
        };
        Some((self.size[0], Solid { form, ..*self }))
    }

    /// The farthest point along a unit vector, and which corner it is: a vertex of a mesh, a corner of a box by its signs, an
    /// end of a capsule or cylinder. Of equally far vertices of a mesh, `last` counts.
    fn farthest(&self, direction: Point, last: Option<u32>) -> (Point, u32) {
        // 0 counts as positive, as in MuJoCo
        let [radius, half, _] = self.size;
        let d = self.local(direction);
        let signed = |x: f64, size: f64| if x >= 0.0 { size } else { -size };
        let end = u32::from(d[2] < 0.0);
        let (local, corner) = match self.form {
            Form::Center => return (self.center, 0),
            Form::Sphere => return (along(self.center, direction, radius), 0),
            Form::Axis => ([0.0, 0.0, signed(d[2], half)], end),
            Form::Capsule => {
                let [x, y, z] = scale(d, radius);
                ([x, y, z + signed(d[2], half)], end)
            }
            Form::Ellipsoid => (self.farthest_of_ellipsoid(d), 0),
            // a point of the rim, or the middle of a cap
            Form::Cylinder => {
                let square = d[0] * d[0] + d[1] * d[1];
                let by = match square >= TINY * TINY {
                    true => radius / square.sqrt(),
                    false => 0.0,
                };
                ([by * d[0], by * d[1], signed(d[2], half)], end)
            }
            Form::Box => {
                // bit k of a corner is its sign along axis k
                let corner = (0..3).map(|k| u32::from(d[k] >= 0.0) << k).sum();
                ([0, 1, 2].map(|k| signed(d[k], self.size[k])), corner)
            }
            Form::Prism(corners) => {
                // of equally far corners the first counts, from below only where the direction is downward
                let first = if d[2] < 0.0 { 0 } else { 3 };
                let farther = |best: usize, k: usize| {
                    if dot(corners[k], d) > dot(corners[best], d) {
                        k
                    } else {
                        best
                    }
                };
                let corner = farther(farther(first, first + 1), first + 2);
                return (corners[corner], 0);
            }
            Form::Mesh(hull) => {
                let corner = hull.farthest(d, last);
                (hull.vertices[corner as usize], corner)
            }
        };
        (self.placed(local), corner)
    }

    /// S² d / |S d|, where S has the radii.
    fn farthest_of_ellipsoid(&self, d: Point) -> Point {
        let size = self.size;
        // a direction without length has the end of the first axis
        let scaled = [0, 1, 2].map(|k| d[k] * size[k]);
        let square = dot(scaled, scaled);
        if square < TINY * TINY {
            return [size[0], 0.0, 0.0];
        }
        let by = 1.0 / square.sqrt();
        [0, 1, 2].map(|k| scaled[k] * (by * size[k]))
    }
}

/// A point of the Minkowski difference of two shapes.
#[derive(Clone, Copy, Debug)]
pub struct Vertex {
    /// The point of the first shape less that of the second, with their skins [m].
    pub point: Point,
    /// The points of both shapes that it comes from, without [m].
    pub on: [Point; 2],
    /// The direction along which it is farthest, a unit vector.
    pub direction: Point,
    /// Which corners of the shapes they are.
    pub corners: [u32; 2],
}

/// Two shapes, and the vertices of their meshes that were farthest last.
#[derive(Clone, Debug)]
pub struct SolidPair<'a> {
    pub solids: [Solid<'a>; 2],
    /// By how much both are larger all around [m].
    pub skin: f64,
    last: [Option<u32>; 2],
}

impl<'a> SolidPair<'a> {
    pub fn new(solids: [Solid<'a>; 2], skin: f64) -> Self {
        SolidPair {
            solids,
            skin,
            last: [None; 2],
        }
    }

    /// Are both shapes polytopes? Skins round their corners.
    pub fn is_discrete(&self) -> bool {
        self.skin == 0.0 && self.solids.iter().all(Solid::is_discrete)
    }

    /// The farthest vertex of the difference along a unit vector.
    pub fn farthest(&mut self, direction: Point) -> Vertex {
        // of A - B, along d: the farthest of A along d less the farthest of B along -d
        let directions = [direction, scale(direction, -1.0)];
        let mut on = [[0.0; 3]; 2];
        let mut corners = [0; 2];
        for (k, solid) in self.solids.iter().enumerate() {
            (on[k], corners[k]) = solid.farthest(directions[k], self.last[k]);
            self.last[k] = Some(corners[k]);
        }
        // both skins are along the direction
        let bare = sub(on[0], on[1]);
        let point = match self.skin > 0.0 {
            true => along(bare, direction, 2.0 * self.skin),
            false => bare,
        };
        Vertex {
            point,
            on,
            direction,
            corners,
        }
    }
}
