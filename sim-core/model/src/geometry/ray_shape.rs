//! Where rays meet shapes, by MuJoCo's rules (`mj_ray`).
//!
//! ```text
//! p + x d, x ≥ 0        the nearest x at which a ray passes the surface, from outside or from inside
//! a x² + 2 b x + c = 0  of round surfaces
//! ```
//!
//! A plane is met from its front alone, and only in its bounds. Normals point out of a shape, whichever side is met.

use std::sync::Arc;

use super::triangle_tree::TriangleTree;
use super::vector::{Vector, dot, norm, scale};

/// Parts of a direction below which a ray does not pass a side, and squared lengths of which a ray has no direction
/// (MuJoCo: `mjMINVAL`) [–].
pub const RAY_SMALL: f64 = 1e-15;

/// What rays meet, in its own frame.
#[derive(Clone)]
pub enum RayShape {
    /// The plane z = 0, with half sizes along x and y [m], 0 where it has no end.
    Plane([f64; 2]),
    /// Radius [m].
    Sphere(f64),
    /// Radius, and half the length of the axis along z [m].
    Capsule(f64, f64),
    /// Half axes [m].
    Ellipsoid([f64; 3]),
    /// Radius, and half the length along z [m].
    Cylinder(f64, f64),
    /// Half sizes [m].
    Box([f64; 3]),
    /// Triangles.
    Mesh(Arc<TriangleTree>),
}

/// Distance in units of the direction, and the normal, not always of length 1.
type Met = Option<(f64, Vector)>;

impl RayShape {
    /// Centre [m] and radius [m] of a sphere around it; infinite of a plane.
    pub fn bounds(&self) -> (Vector, f64) {
        let radius = match self {
            RayShape::Plane(_) => f64::INFINITY,
            RayShape::Sphere(radius) => *radius,
            RayShape::Capsule(radius, half) => radius + half,
            RayShape::Ellipsoid(axes) => axes.iter().copied().fold(0.0, f64::max),
            RayShape::Cylinder(radius, half) => libm::hypot(*radius, *half),
            RayShape::Box(half) => norm(*half),
            RayShape::Mesh(tree) => return tree.bounds(),
        };
        ([0.0; 3], radius)
    }

    /// Where a ray from `origin` [m] along `direction` first meets it, in units of the direction, and the normal of
    /// length 1. Places at `limit` or beyond may be left out.
    pub fn cast(&self, origin: Vector, direction: Vector, limit: f64) -> Met {
        let (p, d) = (origin, direction);
        let met = match self {
            RayShape::Plane(half) => plane(*half, p, d),
            RayShape::Sphere(radius) => round([1.0; 3], *radius, p, d),
            RayShape::Capsule(radius, half) => capsule(*radius, *half, p, d),
            RayShape::Ellipsoid(axes) => round(axes.map(|axis| 1.0 / (axis * axis)), 1.0, p, d),
            RayShape::Cylinder(radius, half) => cylinder(*radius, *half, p, d),
            RayShape::Box(half) => sides(*half, p, d),
            RayShape::Mesh(tree) => return tree.cast(p, d, limit),
        };
        met.map(|(far, normal)| (far, scale(normal, 1.0 / norm(normal))))
    }
}

/// The nearer of what is met.
fn nearer(a: Met, b: Met) -> Met {
    match (a, b) {
        (Some((first, _)), Some((second, _))) if second < first => b,
        (None, _) => b,
        _ => a,
    }
}

/// A point of a ray.
fn at(p: Vector, d: Vector, x: f64) -> Vector {
    [0, 1, 2].map(|k| p[k] + x * d[k])
}

/// Both solutions of a x² + 2 b x + c = 0, the smaller one first.
fn roots(a: f64, b: f64, c: f64) -> Option<[f64; 2]> {
    let inside = b * b - a * c;
    if inside < 0.0 || a < RAY_SMALL {
        return None;
    }
    let root = inside.sqrt();
    Some([(-b - root) / a, (-b + root) / a])
}

/// The first solution that is not negative.
fn first_root(a: f64, b: f64, c: f64) -> Option<f64> {
    roots(a, b, c)?.into_iter().find(|&x| x >= 0.0)
}

fn plane(half: [f64; 2], p: Vector, d: Vector) -> Met {
    if d[2] > -RAY_SMALL {
        return None;
    }
    let far = -p[2] / d[2];
    let is_within = |k: usize| half[k] <= 0.0 || (p[k] + far * d[k]).abs() <= half[k];
    (far >= 0.0 && is_within(0) && is_within(1)).then_some((far, [0.0, 0.0, 1.0]))
}

/// Points q with Σ s q² = radius².
fn round(s: [f64; 3], radius: f64, p: Vector, d: Vector) -> Met {
    let sum = |a: Vector, b: Vector| s[0] * a[0] * b[0] + s[1] * a[1] * b[1] + s[2] * a[2] * b[2];
    let far = first_root(sum(d, d), sum(d, p), sum(p, p) - radius * radius)?;
    let on = at(p, d, far);
    Some((far, [0, 1, 2].map(|k| s[k] * on[k])))
}

/// The side of a cylinder about z.
fn tube(radius: f64, half: f64, p: Vector, d: Vector) -> Met {
    let flat = |v: Vector| [v[0], v[1], 0.0];
    let (q, e) = (flat(p), flat(d));
    let far = first_root(dot(e, e), dot(e, q), dot(q, q) - radius * radius)?;
    let on = at(p, d, far);
    (on[2].abs() <= half).then_some((far, flat(on)))
}

fn capsule(radius: f64, half: f64, p: Vector, d: Vector) -> Met {
    let mut nearest = tube(radius, half, p, d);
    for end in [half, -half] {
        let q = [p[0], p[1], p[2] - end];
        let both = roots(dot(d, d), dot(d, q), dot(q, q) - radius * radius);
        for far in both.into_iter().flatten() {
            let beyond = (p[2] + far * d[2]) * end.signum();
            if far >= 0.0 && beyond >= half {
                nearest = nearer(nearest, Some((far, at(q, d, far))));
            }
        }
    }
    nearest
}

fn cylinder(radius: f64, half: f64, p: Vector, d: Vector) -> Met {
    let mut nearest = None;
    if d[2].abs() > RAY_SMALL {
        for side in [-1.0, 1.0] {
            let far = (side * half - p[2]) / d[2];
            let [x, y, _] = at(p, d, far);
            if far >= 0.0 && x * x + y * y <= radius * radius {
                nearest = nearer(nearest, Some((far, [0.0, 0.0, side])));
            }
        }
    }
    nearer(nearest, tube(radius, half, p, d))
}

fn sides(half: [f64; 3], p: Vector, d: Vector) -> Met {
    let mut nearest = None;
    for axis in 0..3 {
        if d[axis].abs() <= RAY_SMALL {
            continue;
        }
        for side in [-1.0, 1.0] {
            let far = (side * half[axis] - p[axis]) / d[axis];
            let on = at(p, d, far);
            let is_within = (0..3).all(|k| k == axis || on[k].abs() <= half[k]);
            if far >= 0.0 && is_within {
                let mut normal = [0.0; 3];
                normal[axis] = side;
                nearest = nearer(nearest, Some((far, normal)));
            }
        }
    }
    nearest
}
