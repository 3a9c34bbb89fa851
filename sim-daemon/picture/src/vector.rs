//! Three numbers; sim-core's own need a fused multiply-add, which is slow where no hardware has it.

/// x, y, z.
pub type Vector = [f64; 3];

/// a − b
pub fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + s b
pub fn along(a: Vector, s: f64, b: Vector) -> Vector {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// aᵀ b
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b
pub fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// In the same direction with length 1; zero stays zero.
pub fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    if length > 0.0 {
        a.map(|part| part / length)
    } else {
        a
    }
}

/// The middle of a box.
pub fn middle([low, high]: [Vector; 2]) -> Vector {
    std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]))
}

/// Lowest and highest coordinates; zeros if there are no points.
pub fn extent(points: impl Iterator<Item = Vector>) -> [Vector; 2] {
    points
        .fold(None, |extent: Option<[Vector; 2]>, point| {
            let [low, high] = extent.unwrap_or([point; 2]);
            Some([
                std::array::from_fn(|axis| low[axis].min(point[axis])),
                std::array::from_fn(|axis| high[axis].max(point[axis])),
            ])
        })
        .unwrap_or_default()
}
