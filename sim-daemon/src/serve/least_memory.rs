//! The least memory that worlds can take, known before a model is compiled, which takes long for a large one.

use sim_engine::simulation::{Options, Precision};
use sim_model::Description;
use sim_protocol::ProtocolError;
use sim_protocol::host::free_memory;

/// Arrays of a value per dof that every world has: position, velocity, acceleration, force and two targets.
const ARRAYS_MIN: usize = 6;

/// Refuses worlds that cannot fit, whatever the model becomes. The whole count follows once it is compiled.
///
/// # Errors
/// [`ProtocolError::Memory`] with the bytes free and needed.
pub(crate) fn check_least_memory(
    description: &Description,
    options: &Options,
    groups: usize,
) -> Result<(), ProtocolError> {
    let joints = description.robots.iter().flat_map(|robot| &robot.joints);
    let dofs: usize = joints.map(|joint| joint.dofs.len()).sum();
    let needed = least_bytes(
        dofs,
        options.worlds.saturating_mul(groups),
        options.precision,
    );
    let free = free_memory();
    if needed <= free {
        return Ok(());
    }
    let what = format!(
        "at least, for {} worlds of {dofs} dofs",
        options.worlds * groups
    );
    Err(ProtocolError::Memory { free, needed, what })
}

fn least_bytes(dofs: usize, worlds: usize, precision: Precision) -> u64 {
    let real = match precision {
        Precision::F32 => 4,
        Precision::F64 => 8,
    };
    ((ARRAYS_MIN * dofs * real) as u64).saturating_mul(worlds as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_memory_grows_with_dofs_worlds_and_precision_and_never_wraps() {
        assert_eq!(least_bytes(9, 1000, Precision::F32), 9 * 1000 * 24);
        assert_eq!(least_bytes(9, 1000, Precision::F64), 9 * 1000 * 48);
        assert_eq!(least_bytes(0, 1000, Precision::F32), 0);
        assert_eq!(least_bytes(2048, usize::MAX, Precision::F64), u64::MAX);
    }

    #[test]
    fn no_model_takes_less() {
        let mut description = Description::new(0.002, 1);
        for k in 0..20 {
            let mut body = sim_model::Body::new(
                &format!("b{k}"),
                sim_model::Pose::at([f64::from(k), 0.0, 1.0]),
            );
            body.mass = Some(1.0);
            description.add_body(body).unwrap();
        }
        let model = description.compile().unwrap();
        let options = Options {
            worlds: 4096,
            ..Options::default()
        };
        let all = sim_engine::simulation::Simulation::memory_of(&model, &options);
        let least = least_bytes(120, 4096, options.precision);
        assert!(0 < least && least <= all, "{least} and {all}");
    }
}
