//! What carries a link, and how the frame of its joint is turned.

use crate::pose::Pose;

/// The body and tree that carry a link, and the link's frame in that body's.
#[derive(Clone, Copy)]
pub(super) struct Carrier {
    pub body: Option<usize>,
    pub tree: usize,
    pub pose: Pose,
}

/// The axes that a rotation exchanges, if that is all it does (to the rounding of angles such as π/2).
pub(super) fn exchange(columns: [[f64; 3]; 3]) -> Option<[(usize, bool); 3]> {
    let axis = |column: [f64; 3]| {
        let along = |i: usize| (column[i].abs() - 1.0).abs() < 4.0 * f64::EPSILON;
        let rest = |i: usize| (0..3).all(|j| j == i || column[j].abs() < 4.0 * f64::EPSILON);
        let i = (0..3).find(|&i| along(i) && rest(i))?;
        Some((i, column[i] < 0.0))
    };
    Some([axis(columns[0])?, axis(columns[1])?, axis(columns[2])?])
}

/// A rotation that takes z to the given unit vector; none where the axis is z already.
pub(super) fn z_to(axis: [f64; 3]) -> Pose {
    if axis == [0.0, 0.0, 1.0] {
        return Pose::identity();
    }
    if axis[2] < -0.5 {
        // half a turn about x, then the short way from -z
        return z_to([axis[0], -axis[1], -axis[2]]).flipped();
    }
    let quat = [-axis[1], axis[0], 0.0, 1.0 + axis[2]];
    let norm = quat.iter().map(|x| x * x).sum::<f64>().sqrt();
    Pose {
        pos: [0.0; 3],
        quat: quat.map(|x| x / norm),
    }
}

impl Pose {
    /// Half a turn about the parent's x axis, applied after this rotation.
    fn flipped(&self) -> Pose {
        Pose {
            pos: [0.0; 3],
            quat: [1.0, 0.0, 0.0, 0.0],
        }
        .mul(self)
    }
}
