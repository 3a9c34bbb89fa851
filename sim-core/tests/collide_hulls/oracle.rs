//! Exact axes of least depth, by every face and pair of edges.

use super::shapes::*;
use sim_core::model::geometry::Hull;

/// A polytope where it is: its points, the normals of its faces, and its edges with the normals beside them.
pub struct Polytope {
    pub points: Vec<Vector>,
    pub faces: Vec<Vector>,
    /// Direction, and the normals of both faces.
    pub edges: Vec<[Vector; 3]>,
    /// Radius around it.
    pub radius: f64,
    /// Directions of edges that are not told apart by faces: of a box or segment.
    pub directions: Vec<Vector>,
}

impl Polytope {
    pub fn of(shape: Shape, axes: &[Vector; 3], center: Vector, hulls: &Hulls) -> Polytope {
        let place = |x: Vector| add(transform(axes, x), center);
        let mut polytope = Polytope {
            points: vec![center],
            faces: vec![],
            edges: vec![],
            radius: 0.0,
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
                let hull: &Hull = &hulls.hulls[index];
                polytope.points = hulls.vertices[index].iter().map(|&x| place(x)).collect();
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
                        let [one, other] = edge.faces.map(|face| polytope.faces[face as usize]);
                        [unit(sub(to, from)), one, other]
                    })
                    .collect();
            }
            Shape::Plane | Shape::Cylinder(..) => panic!("not a polytope"),
        }
        polytope
    }

    pub fn reach(&self, d: Vector) -> f64 {
        let reach = self
            .points
            .iter()
            .map(|&x| dot(x, d))
            .fold(f64::MIN, f64::max);
        reach + self.radius
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
    for &[d, one, other] in &b.edges {
        for &q in &a.directions {
            if dot(one, q) * dot(other, q) < 0.0 {
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
            let (c, f) = (scale(one, -1.0), scale(other, -1.0));
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
