//! Mass properties: principal moments, the triangle inequality that every body obeys, and bodies merged into one.

use crate::pose::Pose;

/// Roundings of an eigenvalue, relative to the largest; published figures err by more than this or not at all.
const ROUNDING: f64 = 1e-12;
/// What is smaller is zero [kg·m²]: exporters leave such dust in tensors that should be 0. MuJoCo's mjMINVAL.
const DUST: f64 = 1e-15;

/// Mass properties of a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertial {
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass in the link frame [m].
    pub pos: [f64; 3],
    /// Inertia about the centre of mass, in link axes. `(3, 3)` [kg·m²]
    pub inertia: [[f64; 3]; 3],
}

/// Eigenvalues of a symmetric tensor `(3, 3)`, ascending, by cyclic Jacobi rotations [as the tensor].
///
/// Only the upper triangle is read.
pub fn principal_moments(tensor: [[f64; 3]; 3]) -> [f64; 3] {
    let mut a = tensor;
    (a[1][0], a[2][0], a[2][1]) = (a[0][1], a[0][2], a[1][2]);
    // convergence is quadratic: 3 by 3 matrices are diagonal to the last bit after 5 sweeps or 6
    for _sweep in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // tan of the angle that makes a(p,q) vanish, the smaller root of t² + 2 θ t − 1 = 0
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tan = theta.signum() / (theta.abs() + libm::hypot(theta, 1.0));
            let cos = 1.0 / libm::hypot(tan, 1.0);
            let sin = tan * cos;
            let r = 3 - p - q;
            let (apq, arp, arq) = (a[p][q], a[r][p], a[r][q]);
            a[p][p] -= tan * apq;
            a[q][q] += tan * apq;
            (a[p][q], a[q][p]) = (0.0, 0.0);
            a[r][p] = cos * arp - sin * arq;
            a[r][q] = sin * arp + cos * arq;
            (a[p][r], a[q][r]) = (a[r][p], a[r][q]);
        }
    }
    let mut moments = [a[0][0], a[1][1], a[2][2]];
    moments.sort_by(f64::total_cmp);
    moments
}

/// The lowest principal moment if it is negative beyond rounding.
pub(crate) fn negative_moment(inertia: [[f64; 3]; 3]) -> Option<f64> {
    let [low, _, high] = principal_moments(inertia);
    (low < -(ROUNDING * high.abs()).max(DUST)).then_some(low)
}

/// Largest principal moment over the sum of the others, if above 1 beyond rounding.
pub(crate) fn triangle_excess(inertia: [[f64; 3]; 3]) -> Option<f64> {
    let [a, b, c] = principal_moments(inertia);
    (c - (a + b) > (ROUNDING * c).max(DUST)).then(|| c / (a + b))
}

/// Two bodies that are fixed to each other as one; `other` is given in the frame `pose` of the first.
pub(crate) fn merge(body: &Inertial, pose: &Pose, other: &Inertial) -> Inertial {
    let mass = body.mass + other.mass;
    let other_pos = pose.transform(other.pos);
    let pos: [f64; 3] = if mass > 0.0 {
        std::array::from_fn(|i| (body.mass * body.pos[i] + other.mass * other_pos[i]) / mass)
    } else {
        body.pos
    };
    let parts = [
        (body.mass, body.pos, body.inertia),
        (other.mass, other_pos, pose.rotate_tensor(other.inertia)),
    ];
    let mut inertia = [[0.0; 3]; 3];
    for (mass, centre, tensor) in parts {
        // parallel axes: I + m (|d|² 1 − d dᵀ)
        let d: [f64; 3] = std::array::from_fn(|i| centre[i] - pos[i]);
        let square = d.iter().map(|part| part * part).sum::<f64>();
        for i in 0..3 {
            for j in 0..3 {
                let unit = if i == j { square } else { 0.0 };
                inertia[i][j] += tensor[i][j] + mass * (unit - d[i] * d[j]);
            }
        }
    }
    Inertial { mass, pos, inertia }
}
