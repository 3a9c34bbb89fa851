//! Mass, centre of mass and inertia of shapes with uniform density, in f64.
//!
//! Primitives by their closed forms. Meshes by the exact integrals over the tetrahedra between their triangles and a point,
//!
//!     ∫ dV = v = a·(b × c) / 6      ∫ x dV = v s / 4,  s = a + b + c      ∫ x xᵀ dV = v (a aᵀ + b bᵀ + c cᵀ + s sᵀ) / 20
//!
//! signed, so that cavities subtract.

use std::borrow::Cow;
use std::f64::consts::PI;

use super::shape::Shape;
use super::stretch::{Stretched, stretched};
use super::trimesh::TriMesh;
use super::vector::{add, cross, dot, extent, scale, sub};
use crate::error::ModelError;
use crate::inertia::Inertial;

/// Density of a link without a mass in its file [kg/m³]: that of water, as in MuJoCo and Newton.
pub const DENSITY: f64 = 1000.0;

/// Mass properties of a shape of this density [kg/m³], in the shape's frame.
///
/// A mesh that bounds no solid has those of its convex hull.
///
/// # Errors
/// A mesh without volume, by its file; a plane.
pub fn mass_properties(shape: &Shape, density: f64) -> Result<Inertial, ModelError> {
    let centred = |mass: f64, moments: [f64; 3]| {
        let mut inertia = [[0.0; 3]; 3];
        for axis in 0..3 {
            inertia[axis][axis] = moments[axis];
        }
        Inertial {
            mass,
            pos: [0.0; 3],
            inertia,
        }
    };
    Ok(match shape {
        Shape::Plane | Shape::HeightField(_) => {
            let what = "a shape with a mass".to_owned();
            return Err(ModelError::PlaneBorne { what });
        }
        Shape::Box {
            half_extents: [x, y, z],
        } => {
            let mass = density * 8.0 * x * y * z;
            let across = |a: &f64, b: &f64| mass / 3.0 * (a * a + b * b);
            centred(mass, [across(y, z), across(z, x), across(x, y)])
        }
        &Shape::Sphere { radius } => {
            let mass = density * 4.0 / 3.0 * PI * radius.powi(3);
            centred(mass, [0.4 * mass * radius * radius; 3])
        }
        &Shape::Cylinder {
            radius,
            half_height,
        } => {
            let (mass, across, along) = cylinder(radius, half_height, density);
            centred(mass, [across, across, along])
        }
        &Shape::Capsule {
            radius,
            half_height,
        } => {
            let (mass, across, along) = cylinder(radius, half_height, density);
            let caps = density * 4.0 / 3.0 * PI * radius.powi(3);
            // half spheres have their centres 3/8 of the radius beyond the cylinder's ends
            let shift = half_height * half_height + 0.75 * half_height * radius;
            let ball = 0.4 * radius * radius;
            let across = across + caps * (ball + shift);
            centred(mass + caps, [across, across, along + caps * ball])
        }
        Shape::Ellipsoid { radii: [x, y, z] } => {
            let mass = density * 4.0 / 3.0 * PI * x * y * z;
            let across = |a: &f64, b: &f64| 0.2 * mass * (a * a + b * b);
            centred(mass, [across(y, z), across(z, x), across(x, y)])
        }
        Shape::Mesh(mesh) => of_triangles(mesh.solid()?.as_ref(), density),
    })
}

/// Mass, inertia across the axis and along it.
fn cylinder(radius: f64, half_height: f64, density: f64) -> (f64, f64, f64) {
    let square = radius * radius;
    let mass = density * PI * square * 2.0 * half_height;
    let across = mass * (0.25 * square + half_height * half_height / 3.0);
    (mass, across, 0.5 * mass * square)
}

/// Mass properties of what closed triangles bound.
pub(super) fn of_triangles(mesh: &TriMesh, density: f64) -> Inertial {
    // the integrals of a thin mesh are those of the stretched one, mapped back: its own would be lost in roundings
    let (points, back) = match stretched(&mesh.vertices) {
        Ok(Stretched { points, back, .. }) => (points, back),
        Err(_) => (Cow::Borrowed(&mesh.vertices[..]), None),
    };
    let [low, high] = extent(&points);
    // about the middle, so that nothing is lost far from the origin
    let middle = scale(add(low, high), 0.5);
    let (mut volume, mut first, mut second) = (0.0, [0.0; 3], [[0.0; 3]; 3]);
    for &triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| sub(points[corner as usize], middle));
        let part = dot(a, cross(b, c)) / 6.0;
        let sum = add(a, add(b, c));
        volume += part;
        first = add(first, scale(sum, part / 4.0));
        for i in 0..3 {
            for j in 0..3 {
                let products = a[i] * a[j] + b[i] * b[j] + c[i] * c[j] + sum[i] * sum[j];
                second[i][j] += part / 20.0 * products;
            }
        }
    }
    let centre = scale(first, 1.0 / volume);
    for i in 0..3 {
        for j in 0..3 {
            second[i][j] -= volume * centre[i] * centre[j];
        }
    }
    let mut pos = add(middle, centre);
    if let Some(back) = &back {
        volume *= back.volume;
        second = back.moments(second);
        pos = back.place(pos);
    }
    let trace: f64 = (0..3).map(|i| second[i][i]).sum();
    let mut inertia = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            let unit = if i == j { trace } else { 0.0 };
            inertia[i][j] = density * (unit - second[i][j]);
        }
    }
    Inertial {
        mass: density * volume,
        pos,
        inertia,
    }
}
