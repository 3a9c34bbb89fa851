//! Vectors of the reference search. Each operation rounds once, in MuJoCo's order: a fused sum would decide ties otherwise.

/// Three numbers: a point [m], or a direction [–].
pub type Point = [f64; 3];

/// Below this, lengths and areas count as 0 (MuJoCo: `mjMINVAL`).
pub const TINY: f64 = 1e-15;

pub fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: Point, s: f64) -> Point {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a + b s
pub fn along(a: Point, b: Point, s: f64) -> Point {
    add(a, scale(b, s))
}

pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: Point, b: Point) -> Point {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn norm(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// a / |a|, or (1, 0, 0) where a is 0.
pub fn unit(a: Point) -> Point {
    // times the inverse of the length, as MuJoCo does
    let length = norm(a);
    if length < TINY {
        return [1.0, 0.0, 0.0];
    }
    scale(a, 1.0 / length)
}

/// a · (b × c)
pub fn volume(a: Point, b: Point, c: Point) -> f64 {
    dot(a, cross(b, c))
}

/// Σ wᵢ pᵢ
pub fn weighted(weights: &[f64], points: impl Iterator<Item = Point>) -> Point {
    // from the first product on: 0 + x could change the sign of a zero
    let mut terms = weights.iter().zip(points).map(|(w, p)| scale(p, *w));
    let first = terms.next().unwrap_or([0.0; 3]);
    terms.fold(first, add)
}
