//! What derives from mass at the reference pose q = 0, in f64.

use super::ModelError;
use super::constants::Constants;
use crate::math::spatial::{Spatial, momentum, place, power};
use crate::math::vec3::{cross, transform, transform_add};
use faer::linalg::solvers::DenseSolveCore;

/// Inverse weights at q = 0.
pub(super) struct Reference {
    /// Diagonal of M⁻¹, MuJoCo's `dof_invweight0`.
    pub dof_inverse_weight: Vec<f64>,
    /// Mean of the diagonal of M, MuJoCo's `stat.meaninertia`.
    pub mean_inertia: f64,
}

/// M = Σ over bodies of Jᵀ I J, from its definition: the recursion of `step/mass_matrix.rs` is
/// checked against MuJoCo, and this one against both.
pub(super) fn at_reference(
    constants: &Constants<f64>,
    names: &[String],
) -> Result<Reference, ModelError> {
    let n = constants.dofs.len();
    if n == 0 {
        return Ok(Reference {
            dof_inverse_weight: Vec::new(),
            mean_inertia: 1.0,
        });
    }
    let mut frames: Vec<([[f64; 3]; 3], [f64; 3])> = Vec::with_capacity(n);
    let mut motions: Vec<Spatial<f64>> = Vec::with_capacity(n);
    let mut mass_matrix = faer::Mat::<f64>::zeros(n, n);
    for (k, dof) in constants.dofs.iter().enumerate() {
        let (rotation, origin) = match dof.parent {
            Some(p) => {
                let (r, o) = &frames[p];
                (
                    dof.rotation.map(|c| transform(r, c)),
                    transform_add(r, dof.position, *o),
                )
            }
            None => (dof.rotation, dof.position),
        };
        let z = rotation[2];
        motions.push(if dof.revolute {
            [cross(origin, z), z]
        } else {
            [z, [0.0; 3]]
        });
        let inertia = place::<f64>(dof.mass, dof.center, dof.inertia, &rotation, origin);
        frames.push((rotation, origin));
        let mut i = Some(k);
        while let Some(a) = i {
            let force = momentum(&inertia, &motions[a]);
            let mut j = Some(k);
            while let Some(b) = j {
                mass_matrix[(a, b)] += power(&motions[b], &force);
                j = constants.dofs[b].parent;
            }
            i = constants.dofs[a].parent;
        }
        mass_matrix[(k, k)] += dof.armature;
    }
    let mean_inertia = (0..n).map(|k| mass_matrix[(k, k)]).sum::<f64>() / n as f64;
    if let Some(k) = (0..n).find(|&k| mass_matrix[(k, k)].is_nan() || mass_matrix[(k, k)] <= 0.0) {
        return Err(ModelError::NoInertia {
            joint: names[k].clone(),
        });
    }
    let factor = mass_matrix
        .llt(faer::Side::Lower)
        .map_err(|_| ModelError::SingularMass)?;
    let inverse = factor.inverse();
    Ok(Reference {
        dof_inverse_weight: (0..n).map(|k| inverse[(k, k)]).collect(),
        mean_inertia,
    })
}
