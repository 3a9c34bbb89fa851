//! Exact axes of least depth, by every face and pair of edges.

use super::shapes::*;
use sim_model::geometry::Hull;

/// A polytope where it is: its points, the normals of its faces, and its edges with the normals beside them.
pub struct Polytope {
    pub points: Vec<Vector>,
    pub faces: Vec<Vector>,
    /// Direction, and the normals of both faces.
    pub edges: Vec<[Vector; 3]>,
    /// Radius around it.
    pub radius: f64,
    /// Axis and radius of discs about the points: of a cylinder.
    pub discs: Option<(Vector, f64)>,
    /// Half axes of an ellipsoid about the point.
    pub half_axes: Option<[Vector; 3]>,
    /// Directions of edges that faces do not distinguish: of a box or segment.
    pub directions: Vec<Vector>,
}

impl Polytope {
    pub fn from_shape(
        shape: Shape,
        axes: &[Vector; 3],
        center: Vector,
        hulls: &[Hull],
    ) -> Polytope {
        let place = |x: Vector| add(transform(axes, x), center);
        let mut polytope = Polytope {
            points: vec![center],
            faces: vec![],
            edges: vec![],
            radius: 0.0,
            discs: None,
            half_axes: None,
            directions: vec![],
        };
        match shape {
            Shape::Sphere(radius) => polytope.radius = radius,
            Shape::Capsule(radius, half) => {
                polytope.points = vec![place([0.0, 0.0, half]), place([0.0, 0.0, -half])];
                polytope.radius = radius;
                polytope.directions = vec![axes[2]];
            }
            Shape::Box(half) => {
                polytope.points = (0..8)
                    .map(|corner| {
                        let side = |i: usize| {
                            if corner >> i & 1 == 1 {
                                half[i]
                            } else {
                                -half[i]
                            }
                        };
                        place([side(0), side(1), side(2)])
                    })
                    .collect();
                polytope.faces = axes.iter().flat_map(|&x| [x, scale(x, -1.0)]).collect();
                polytope.directions = axes.to_vec();
            }
            Shape::Hull(index) => {
                let hull = &hulls[index];
                polytope.points = hull.vertices.iter().map(|&x| place(x)).collect();
                polytope.faces = hull
                    .faces
                    .iter()
                    .map(|face| transform(axes, face.normal))
                    .collect();
                polytope.edges = hull
                    .edges
                    .iter()
                    .map(|edge| {
                        let [from, to] = edge.ends.map(|end| polytope.points[end as usize]);
                        let [first, other] = edge.faces.map(|face| polytope.faces[face as usize]);
                        [unit(sub(to, from)), first, other]
                    })
                    .collect();
            }
            Shape::Cylinder(radius, half) => {
                polytope.points = vec![place([0.0, 0.0, half]), place([0.0, 0.0, -half])];
                polytope.discs = Some((axes[2], radius));
            }
            Shape::Ellipsoid(radii) => {
                polytope.half_axes = Some([0, 1, 2].map(|i| scale(axes[i], radii[i])));
            }
            Shape::Plane => panic!("a plane has no end"),
        }
        polytope
    }

    /// Is its surface curved, but for a radius around it?
    pub fn is_curved(&self) -> bool {
        self.discs.is_some() || self.half_axes.is_some()
    }

    pub fn reach(&self, d: Vector) -> f64 {
        let reach = self
            .points
            .iter()
            .map(|&x| dot(x, d))
            .fold(f64::MIN, f64::max);
        let disc = match self.discs {
            Some((axis, radius)) => {
                let across = cross(axis, d);
                radius * dot(across, across).sqrt()
            }
            None => 0.0,
        };
        let round = match self.half_axes {
            Some(half) => half.iter().map(|&x| dot(x, d).powi(2)).sum::<f64>().sqrt(),
            None => 0.0,
        };
        reach + disc + round + self.radius
    }
}

/// Distance of two polytopes along a unit vector from a to b.
pub fn along(a: &Polytope, b: &Polytope, n: Vector) -> f64 {
    -b.reach(scale(n, -1.0)) - a.reach(n)
}

/// The largest distance along any axis that can be the best where they penetrate.
pub fn least_depth(a: &Polytope, b: &Polytope) -> (f64, Vector) {
    let mut best = (f64::MIN, [0.0; 3]);
    let mut offer = |n: Vector| {
        let distance = along(a, b, n);
        if distance > best.0 {
            best = (distance, n);
        }
    };
    a.faces.iter().for_each(|&n| offer(n));
    b.faces.iter().for_each(|&n| offer(scale(n, -1.0)));
    for &[d, normal, other] in &b.edges {
        for &q in &a.directions {
            if dot(normal, q) * dot(other, q) < 0.0 {
                let n = cross(d, q);
                if dot(n, n) > 1e-12 {
                    let n = unit(n);
                    offer(n);
                    offer(scale(n, -1.0));
                }
            }
        }
        for &[e, first, second] in &a.edges {
            // both arcs of normals, b's turned round, cross on the same side (Gregorius, GDC 2013)
            let (c, f) = (scale(normal, -1.0), scale(other, -1.0));
            let (arc_a, arc_b) = (cross(second, first), cross(f, c));
            let (cba, dba) = (dot(c, arc_a), dot(f, arc_a));
            let (adc, bdc) = (dot(first, arc_b), dot(second, arc_b));
            if cba * dba < 0.0 && adc * bdc < 0.0 && cba * bdc > 0.0 {
                let n = cross(d, e);
                if dot(n, n) > 1e-12 {
                    let n = unit(n);
                    offer(n);
                    offer(scale(n, -1.0));
                }
            }
        }
    }
    best
}

/// The largest distance along any axis near `start`, and that axis: by ever smaller steps.
pub fn climb(a: &Polytope, b: &Polytope, start: Vector, first_step: f64) -> (f64, Vector) {
    let (mut n, mut best, mut step) = (start, along(a, b, start), first_step);
    let mut turn: f64 = 0.3;
    while step > 1e-9 {
        let side = if n[0].abs() < 0.6 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let u = unit(cross(n, side));
        let v = cross(n, u);
        let mut better = None;
        for k in 0..8 {
            let angle = turn + f64::from(k) * std::f64::consts::FRAC_PI_4;
            let (sin, cos) = angle.sin_cos();
            let m = unit(add(n, add(scale(u, step * cos), scale(v, step * sin))));
            let x = along(a, b, m);
            if x > best {
                (best, better) = (x, Some(m));
            }
        }
        turn += 1.0;
        match better {
            Some(m) => n = m,
            None => step *= 0.7,
        }
    }
    (best, n)
}

/// The distance of two shapes, negative in penetration: the largest along any axis, from many starts.
pub fn farthest_axis(a: &Polytope, b: &Polytope) -> (f64, Vector) {
    let mut starts: Vec<(f64, Vector)> = (0..600)
        .map(|i| {
            let z = (f64::from(i) + 0.5) / 300.0 - 1.0;
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let width = (1.0 - z * z).sqrt();
            let n = [cos * width, sin * width, z];
            (along(a, b, n), n)
        })
        .collect();
    starts.sort_by(|x, y| y.0.total_cmp(&x.0));
    let climbed = starts[..8].iter().map(|start| climb(a, b, start.1, 0.1));
    climbed.max_by(|x, y| x.0.total_cmp(&y.0)).unwrap()
}
