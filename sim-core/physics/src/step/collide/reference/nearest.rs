//! The point of a simplex that is nearest to the origin, by signed volumes (Montanari, Petrinic and Barbieri 2017, "Improving
//! the GJK algorithm for faster and more reliable distance queries between convex objects").

use super::vector::{Point, TINY, add, along, cross, dot, scale, sub, volume, weighted};

/// The origin projected onto a plane through three points; none where they are on a line.
///
/// The normal comes from the corner where that is not perpendicular to its position, of the three.
pub fn project_onto_plane(a: Point, b: Point, c: Point) -> Option<Point> {
    // (n · p / n²) n, where p is any corner
    let (ab, ac, bc) = (sub(b, a), sub(c, a), sub(c, b));
    let corners = [(cross(bc, ab), b), (cross(ab, ac), a), (cross(ac, bc), c)];
    for (k, (normal, corner)) in corners.into_iter().enumerate() {
        let (height, square) = (dot(normal, corner), dot(normal, normal));
        if square == 0.0 && k < 2 {
            return None;
        }
        if k == 2 || (height != 0.0 && square > TINY) {
            return Some(scale(normal, height / square));
        }
    }
    None
}

/// Do both numbers have the same sign, and is neither 0?
fn agree(a: f64, b: f64) -> bool {
    (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0)
}

/// The axes that see most of a triangle, and its signed area there.
fn widest(a: Point, b: Point, c: Point) -> (f64, usize, usize) {
    let area = |x: usize, y: usize| {
        b[x] * c[y] - b[y] * c[x] - a[x] * c[y] + a[y] * c[x] + a[x] * b[y] - a[y] * b[x]
    };
    // of equally wide ones, the first axis is left out
    let areas = [area(1, 2), area(0, 2), area(0, 1)];
    let [x, y, z] = areas.map(f64::abs);
    if x >= y && x >= z {
        (areas[0], 1, 2)
    } else if y >= z {
        (areas[1], 0, 2)
    } else {
        (areas[2], 0, 1)
    }
}

/// Signed areas of the triangles of p with two corners each, and of all three corners, along the axis that sees most of it.
fn areas(a: Point, b: Point, c: Point, p: Point) -> ([f64; 3], f64) {
    // in the plane that shows it widest, so that no digit is lost
    let (whole, x, y) = widest(a, b, c);
    let area = |q: Point, r: Point| {
        p[x] * q[y] + p[y] * r[x] + q[x] * r[y] - p[x] * r[y] - p[y] * q[x] - r[x] * q[y]
    };
    ([area(b, c), area(c, a), area(a, b)], whole)
}

/// Affine coordinates of a point in the plane of a triangle.
pub fn affine([a, b, c]: [Point; 3], p: Point) -> [f64; 3] {
    let (parts, whole) = areas(a, b, c, p);
    parts.map(|part| part / whole)
}

fn weights_of_segment(a: Point, b: Point) -> [f64; 2] {
    let ab = sub(b, a);
    let projected = along(b, ab, -(dot(b, ab) / dot(ab, ab)));
    // the axis that sees most of it; of equal ones the last
    let mut most = a[0] - b[0];
    let mut axis = 0;
    for k in 1..3 {
        let extent = a[k] - b[k];
        if extent.abs() >= most.abs() {
            (most, axis) = (extent, k);
        }
    }
    // the parts of the segment beyond the projection; outside of it, the second end is the nearest point
    let parts = [projected[axis] - b[axis], a[axis] - projected[axis]];
    match parts.iter().all(|part| agree(most, *part)) {
        true => parts.map(|part| part / most),
        false => [0.0, 1.0],
    }
}

fn weights_of_triangle(a: Point, b: Point, c: Point) -> [f64; 3] {
    let Some(projected) = project_onto_plane(a, b, c) else {
        let [x, y] = weights_of_segment(a, b);
        return [x, y, 0.0];
    };
    // inside the triangle, the areas of its parts are the weights
    let (parts, whole) = areas(a, b, c, projected);
    if parts.iter().all(|part| agree(whole, *part)) {
        return parts.map(|part| part / whole);
    }
    // the nearest of the edges that it is beyond
    let corners = [a, b, c];
    let mut best = [0.0; 3];
    let mut least = f64::MAX;
    for (k, [i, j]) in [[1, 2], [0, 2], [0, 1]].into_iter().enumerate() {
        if agree(whole, parts[k]) {
            continue;
        }
        let weights = weights_of_segment(corners[i], corners[j]);
        let point = weighted(&weights, [corners[i], corners[j]].into_iter());
        let square = dot(point, point);
        if k == 0 || square < least {
            (least, best) = (square, [0.0; 3]);
            (best[i], best[j]) = (weights[0], weights[1]);
        }
    }
    best
}

fn weights_of_tetrahedron([a, b, c, d]: [Point; 4]) -> [f64; 4] {
    // volumes of the origin with three corners each; those of the origin inside have the sign of the whole
    let parts = [
        -volume(b, c, d),
        volume(a, c, d),
        -volume(a, b, d),
        volume(a, b, c),
    ];
    let whole = parts[0] + parts[1] + parts[2] + parts[3];
    if parts.iter().all(|part| agree(whole, *part)) {
        return parts.map(|part| part / whole);
    }
    // the nearest of the faces that it is beyond
    let corners = [a, b, c, d];
    let mut best = [0.0; 4];
    let mut least = f64::MAX;
    let faces = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
    for (k, face) in faces.into_iter().enumerate() {
        if agree(whole, parts[k]) {
            continue;
        }
        let [p, q, r] = face.map(|i| corners[i]);
        let weights = weights_of_triangle(p, q, r);
        let point = weighted(&weights, [p, q, r].into_iter());
        let square = dot(point, point);
        if k == 0 || square < least {
            (least, best) = (square, [0.0; 4]);
            for (i, weight) in face.into_iter().zip(weights) {
                best[i] = weight;
            }
        }
    }
    best
}

/// Weights of the corners of a simplex at its point nearest to the origin; 0 of those that it has not.
pub fn nearest_weights(corners: &[Point]) -> [f64; 4] {
    // corners with weight 0 are left out by the caller
    match *corners {
        [a, b, c, d] => weights_of_tetrahedron([a, b, c, d]),
        [a, b, c] => {
            let [x, y, z] = weights_of_triangle(a, b, c);
            [x, y, z, 0.0]
        }
        [a, b] => {
            let [x, y] = weights_of_segment(a, b);
            [x, y, 0.0, 0.0]
        }
        _ => [1.0, 0.0, 0.0, 0.0],
    }
}

/// The middle of some points.
pub fn middle(points: &[Point]) -> Point {
    let sum = points[1..].iter().fold(points[0], |sum, p| add(sum, *p));
    scale(sum, 1.0 / points.len() as f64)
}
