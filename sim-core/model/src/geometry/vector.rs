//! Arithmetic of points in f64, without fused operations: results are the same on every processor, and fast on those
//! where a fused operation would be a library call.

/// A point or direction.
pub type Vector = [f64; 3];

pub(super) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline]
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(a: Vector, s: f64) -> Vector {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a · b.
#[inline]
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[inline]
pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// The direction of `a`; of nothing, nothing.
pub(super) fn unit(a: Vector) -> Vector {
    let length = norm(a);
    if length > 0.0 {
        scale(a, 1.0 / length)
    } else {
        [0.0; 3]
    }
}

/// Length of a triangle's longest edge.
pub(super) fn longest([a, b, c]: [Vector; 3]) -> f64 {
    norm(sub(a, b)).max(norm(sub(b, c))).max(norm(sub(c, a)))
}

/// Twice the area of a triangle, along its normal.
pub(super) fn area_vector([a, b, c]: [Vector; 3]) -> Vector {
    cross(sub(b, a), sub(c, a))
}

/// Six times the signed volume of the tetrahedron between a triangle and a point; of slivers too, since the area is that of
/// the two shorter edges.
pub(super) fn six_volumes(origin: Vector, [a, b, c]: [Vector; 3]) -> f64 {
    let edges = [sub(b, a), sub(c, b), sub(a, c)];
    let squares = edges.map(|edge| dot(edge, edge));
    let longest = (0..3).fold(
        0,
        |best, i| if squares[i] > squares[best] { i } else { best },
    );
    let area = cross(edges[(longest + 1) % 3], edges[(longest + 2) % 3]);
    dot(sub(a, origin), area)
}

/// Lowest and highest coordinates of points; both infinite where there is none.
pub(super) fn extent(points: &[Vector]) -> [Vector; 2] {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    [low, high]
}

/// Diagonal of the box around points [as the points].
pub(super) fn size(points: &[Vector]) -> f64 {
    let [low, high] = extent(points);
    if points.is_empty() {
        0.0
    } else {
        norm(sub(high, low))
    }
}
