//! Thin clouds of points, stretched until rounding no longer matters: a linear map keeps which points are on the hull.

use std::borrow::Cow;

use super::vector::{Vector, add, area_vector, cross, dot, norm, scale, size, sub, unit};

/// Points with less extent than this, relative to the largest extent, count as one point, a line or a flat sheet. Rounding
/// of f64 leaves 1e-12 of the size where a mesh is 10,000 times its size away from the origin.
const FLAT: f64 = 1e-9;
/// Extent to which thin directions are stretched, relative to the largest: parry3d is exact there, and tolerances of hulls
/// are small shares of the thickness. What is thicker is left as it is.
const STRETCHED: f64 = 1e-2;

/// Why points have no hull.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoHull {
    /// Fewer than three, all at one place or on a line, or not finite.
    #[error("its vertices lie on a line")]
    Thin,
    /// In one plane; a [`super::Hull`] is a plate then.
    #[error("it lies in a plane")]
    Flat {
        /// Unit normal of the plane [–].
        normal: [f64; 3],
    },
    /// A hull that rounding keeps from being closed and convex.
    #[error("its convex hull cannot be computed")]
    Failed,
}

/// Points in which every direction has an extent that counts.
pub(super) struct Stretched<'a> {
    /// The points as they were, or stretched along thin directions; the same points are on the hull.
    pub points: Cow<'a, [Vector]>,
    /// Four of them far apart: the ends of the longest axis, the farthest from their line, then from that plane.
    pub simplex: [u32; 4],
    /// What leads from the points back to what they were, where they are stretched.
    pub back: Option<Back>,
    /// Volume of the box around that simplex, before the stretching [as the points, cubed].
    pub room: f64,
}

/// The map from stretched points to those that they were.
pub(super) struct Back {
    /// Where the stretched origin is [as the points].
    pub origin: Vector,
    /// What the stretched axes are, each as long as a unit along it was.
    pub axes: [Vector; 3],
    /// Volume over stretched volume [–].
    pub volume: f64,
}

impl Back {
    /// Where a stretched point was.
    pub fn place(&self, [x, y, z]: Vector) -> Vector {
        let [u, v, w] = self.axes;
        add(self.origin, add(scale(u, x), add(scale(v, y), scale(w, z))))
    }

    /// Second moments of a volume, from those of the stretched one.
    pub fn moments(&self, stretched: [Vector; 3]) -> [Vector; 3] {
        let entry = |i: usize, j: usize| -> f64 {
            let of_row = |k: usize| {
                let row = stretched[k];
                (0..3).map(|l| row[l] * self.axes[l][j]).sum::<f64>()
            };
            (0..3).map(|k| self.axes[k][i] * of_row(k)).sum()
        };
        std::array::from_fn(|i| std::array::from_fn(|j| self.volume * entry(i, j)))
    }
}

/// Stretches points along their thin directions.
///
/// # Errors
/// Points without extent in all three directions.
pub(super) fn stretched(points: &[Vector]) -> Result<Stretched<'_>, NoHull> {
    let largest = size(points);
    let least = FLAT * largest;
    let farthest = |measure: &dyn Fn(Vector) -> f64| {
        let values = points.iter().map(|&point| measure(point)).enumerate();
        values
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((0, 0.0))
    };
    let mut ends = [(0, 0.0), (0, 0.0)];
    for axis in 0..3 {
        let (low, _) = farthest(&|point| -point[axis]);
        let (high, _) = farthest(&|point| point[axis]);
        if let (Some(a), Some(b)) = (points.get(low), points.get(high))
            && norm(sub(*b, *a)) > ends[1].1
        {
            ends = [(low, 0.0), (high, norm(sub(*b, *a)))];
        }
    }
    let length = ends[1].1;
    if length <= least || least == 0.0 {
        return Err(NoHull::Thin);
    }
    let (a, b) = (points[ends[0].0], points[ends[1].0]);
    let along = unit(sub(b, a));
    let (third, width) = farthest(&|point| norm(cross(along, sub(point, a))));
    if width <= least {
        return Err(NoHull::Thin);
    }
    let normal = unit(area_vector([a, b, points[third]]));
    let (fourth, height) = farthest(&|point| dot(normal, sub(point, a)).abs());
    if height <= least {
        return Err(NoHull::Flat { normal });
    }
    let simplex = [ends[0].0, ends[1].0, third, fourth].map(|index| index as u32);
    let room = length * width * height;
    let enough = STRETCHED * largest;
    if width >= enough && height >= enough {
        let points = Cow::Borrowed(points);
        return Ok(Stretched {
            points,
            simplex,
            back: None,
            room,
        });
    }
    let axes = [along, unit(cross(normal, along)), normal];
    let factors = [length, width, height].map(|extent| (enough / extent).max(1.0));
    let place = |&point: &Vector| {
        let from = sub(point, a);
        std::array::from_fn(|i| factors[i] * dot(axes[i], from))
    };
    Ok(Stretched {
        points: points.iter().map(place).collect(),
        simplex,
        back: Some(Back {
            origin: a,
            axes: std::array::from_fn(|i| scale(axes[i], 1.0 / factors[i])),
            volume: 1.0 / (factors[0] * factors[1] * factors[2]),
        }),
        room,
    })
}
