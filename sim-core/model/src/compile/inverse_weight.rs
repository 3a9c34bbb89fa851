//! Inverse weights at the reference pose q = 0, in f64.

use crate::error::ModelError;
use sim_physics::constants::{Constants, Motion};
use sim_physics::math::spatial::{Inertia, Spatial};
use sim_physics::math::vec3::{Mat3, Vec3};

/// Inverse weights at q = 0.
pub(super) struct Reference {
    /// Diagonal of M⁻¹, MuJoCo's `dof_invweight0`.
    pub dof_inverse_weight: Vec<f64>,
    /// Mean over the axes of the translational diagonal of J M⁻¹ Jᵀ at each link's centre of mass, 0 where it stands
    /// still: MuJoCo's `body_invweight0` [1/kg].
    pub link_inverse_weight: Vec<f64>,
    /// Mean of the diagonal of M, MuJoCo's `stat.meaninertia`.
    pub mean_inertia: f64,
    /// Largest ratio over the dofs of the inertia while all others are locked to that while they are free: how
    /// many digits of M cancel in a solve.
    pub locked_over_free: f64,
}

/// M = Σ over bodies of Jᵀ I J, from its definition: the recursion of `step/tree/mass_matrix.rs` is
/// checked against MuJoCo, and this one against both.
pub(super) fn at_reference(
    constants: &Constants<f64>,
    names: &[String],
) -> Result<Reference, ModelError> {
    let n = constants.dofs.len();
    if n == 0 {
        return Ok(Reference {
            dof_inverse_weight: Vec::new(),
            link_inverse_weight: vec![0.0; constants.frames.len()],
            mean_inertia: 1.0,
            locked_over_free: 1.0,
        });
    }
    let (mut mass_matrix, frames, motions) = mass_matrix(constants);
    for (k, dof) in constants.dofs.iter().enumerate() {
        mass_matrix[(k, k)] += dof.armature;
    }
    let mean_inertia = (0..n).map(|k| mass_matrix[(k, k)]).sum::<f64>() / n as f64;
    if let Some(k) = (0..n).find(|&k| mass_matrix[(k, k)].is_nan() || mass_matrix[(k, k)] <= 0.0) {
        return Err(ModelError::NoInertia {
            joint: names[k].clone(),
        });
    }
    let inverse = inverse(&mass_matrix)?;
    let link_inverse_weight = constants
        .frames
        .iter()
        .map(|link| match link.body {
            None => 0.0,
            Some(body) => {
                let (rotation, origin) = &frames[body];
                let center = rotation.mul_add(Vec3(link.center), *origin);
                link_weight(&path(constants, body), &motions, center, &inverse)
            }
        })
        .collect();
    let mut dof_inverse_weight: Vec<f64> = (0..n).map(|k| inverse[(k, k)]).collect();
    let locked_over_free = (0..n)
        .map(|k| mass_matrix[(k, k)] * inverse[(k, k)])
        .fold(1.0, f64::max);
    // the dofs of a ball, and the translations and rotations of a free body, share their mean
    for body in constants
        .bodies
        .iter()
        .filter(|body| body.motion.dofs() > 1)
    {
        for part in dof_inverse_weight[body.dofs()].chunks_exact_mut(3) {
            let mean = part.iter().sum::<f64>() / 3.0;
            part.fill(mean);
        }
    }
    Ok(Reference {
        dof_inverse_weight,
        link_inverse_weight,
        mean_inertia,
        locked_over_free,
    })
}

/// The inverse of a symmetric matrix whose lower triangle is given, by its Cholesky factor L: L⁻ᵀ L⁻¹.
///
/// Sums run in index order. faer tells whether there is an inverse; the last bits of its own depend on the vector instructions
/// of the processor.
fn inverse(matrix: &faer::Mat<f64>) -> Result<faer::Mat<f64>, ModelError> {
    let singular = || ModelError::SingularMass;
    matrix.llt(faer::Side::Lower).map_err(|_| singular())?;
    let n = matrix.nrows();
    let mut factor = faer::Mat::<f64>::zeros(n, n);
    let mut half = faer::Mat::<f64>::zeros(n, n);
    for i in 0..n {
        for j in 0..i {
            let left = (0..j).fold(matrix[(i, j)], |sum, k| {
                sum - factor[(i, k)] * factor[(j, k)]
            });
            factor[(i, j)] = left / factor[(j, j)];
        }
        let square = (0..i).fold(matrix[(i, i)], |sum, k| {
            sum - factor[(i, k)] * factor[(i, k)]
        });
        if square.is_nan() || square <= 0.0 {
            return Err(singular());
        }
        factor[(i, i)] = square.sqrt();
        for j in 0..i {
            let left = (j..i).fold(0.0, |sum, k| sum - factor[(i, k)] * half[(k, j)]);
            half[(i, j)] = left / factor[(i, i)];
        }
        half[(i, i)] = 1.0 / factor[(i, i)];
    }
    Ok(faer::Mat::from_fn(n, n, |i, j| {
        (i.max(j)..n).fold(0.0, |sum, k| sum + half[(k, i)] * half[(k, j)])
    }))
}

/// Inverse weight of a link whose centre is at `center`, moved by the dofs of `path`.
fn link_weight(
    path: &[usize],
    motions: &[Spatial<f64>],
    center: Vec3<f64>,
    inverse: &faer::Mat<f64>,
) -> f64 {
    let columns: Vec<Spatial<f64>> = path
        .iter()
        .map(|&d| {
            let Spatial([linear, angular]) = motions[d];
            Spatial([angular.cross_add(center, linear), angular])
        })
        .collect();
    let [linear, angular] = [0, 1].map(|part| {
        let mut sum = 0.0;
        for (a, &i) in columns.iter().zip(path) {
            for (b, &j) in columns.iter().zip(path) {
                sum += a[part].dot(b[part]) * inverse[(i, j)];
            }
        }
        sum / 3.0
    });
    // MuJoCo: what only turns about its centre weighs as it turns
    if linear < WEIGHT_MIN && angular > WEIGHT_MIN {
        angular
    } else {
        linear.max(WEIGHT_MIN)
    }
}

/// MuJoCo's `mjMINVAL`: below it an inverse weight counts as none.
const WEIGHT_MIN: f64 = 1e-15;

/// Rotation, by columns, and origin of each body's frame.
type Frames = Vec<(Mat3<f64>, Vec3<f64>)>;

fn mass_matrix(constants: &Constants<f64>) -> (faer::Mat<f64>, Frames, Vec<Spatial<f64>>) {
    let n = constants.dofs.len();
    let mut mass_matrix = faer::Mat::<f64>::zeros(n, n);
    let mut frames: Frames = Vec::new();
    let mut motions: Vec<Spatial<f64>> = Vec::with_capacity(n);
    for body in &constants.bodies {
        let (rotation, mut origin) = match body.parent {
            Some(p) => {
                let (r, o) = &frames[p];
                (
                    Mat3(body.rotation.map(|c| r * Vec3(c))),
                    r.mul_add(Vec3(body.position), *o),
                )
            }
            None => (Mat3::constant(body.rotation), Vec3(body.position)),
        };
        let turn = |axis| Spatial([origin.cross(axis), axis]);
        let z = rotation[2];
        match body.motion {
            Motion::Mocap => {}
            Motion::Revolute => motions.push(turn(z)),
            Motion::Prismatic => motions.push(Spatial([z, Vec3::zero()])),
            Motion::Ball => motions.extend(rotation.0.map(turn)),
            Motion::Free => {
                // about its centre of mass; how it lies in the world changes no inverse weight below it
                origin = -Vec3(body.center);
                motions.extend(rotation.0.map(|axis| Spatial([axis, Vec3::zero()])));
                motions.extend(rotation.0.map(|axis| Spatial([Vec3::zero(), axis])));
            }
        }
        let inertia = Inertia::placed(
            body.mass,
            Vec3(body.center),
            body.inertia,
            &rotation,
            origin,
        );
        frames.push((rotation, origin));
        let path = path(constants, frames.len() - 1);
        for &a in &path {
            let force = inertia * motions[a];
            // the factor reads the lower triangle
            for &b in path.iter().filter(|&&b| b <= a) {
                mass_matrix[(a, b)] += motions[b].dot(force);
            }
        }
    }
    (mass_matrix, frames, motions)
}

/// The dofs that move a body, its own first. Sums in this order are part of the model's hash.
fn path(constants: &Constants<f64>, body: usize) -> Vec<usize> {
    let mut dofs = Vec::new();
    let mut next = Some(body);
    while let Some(b) = next {
        dofs.extend(constants.bodies[b].dofs());
        next = constants.bodies[b].parent;
    }
    dofs
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::linalg::solvers::DenseSolveCore as _;

    #[test]
    fn the_inverse_is_that_of_faer_to_roundings() {
        let n = 40;
        // diagonally dominant, so its condition is below n
        let matrix = faer::Mat::from_fn(n, n, |i, j| match i == j {
            true => n as f64,
            false => libm::sin((i * j + i.min(j)) as f64),
        });
        let actual = inverse(&matrix).unwrap();
        let expected = matrix.llt(faer::Side::Lower).unwrap().inverse();
        let largest = (&actual - &expected).norm_max();
        // n sums of n roundings each, times the condition, of entries of 1/n
        let tolerance = (n * n) as f64 * f64::EPSILON;
        assert!(largest > 0.0 && largest < tolerance, "{largest:e}");
    }

    #[test]
    fn a_matrix_without_an_inverse_is_refused() {
        let matrix = faer::Mat::from_fn(3, 3, |_, _| 1.0);
        assert!(matches!(inverse(&matrix), Err(ModelError::SingularMass)));
    }
}
