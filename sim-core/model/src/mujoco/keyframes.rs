//! Keyframes of a model: named states.

use super::format::ModelFile;
use super::names::names;
use crate::description::Keyframe;
use crate::error::ModelError;

/// Reads the keyframes; numbers are as MuJoCo has them.
pub(super) fn keyframes(file: &ModelFile) -> Result<Vec<Keyframe>, ModelError> {
    let count = file.rows("key_time");
    let names = names(file, "key", count)?;
    let rows = |array: &str, width: usize| {
        let all = file.reals(array, count * width)?;
        if let Some(place) = all.iter().position(|x| !x.is_finite()) {
            let name = &names[place / width];
            return Err(file.fault(format!("has an infinite number in keyframe `{name}`")));
        }
        let row = |k: usize| all[k * width..(k + 1) * width].to_vec();
        Ok::<_, ModelError>((0..count).map(row).collect::<Vec<_>>())
    };
    let actuators = file.rows("actuator_trntype");
    let states = file.integers("actuator_actnum", actuators)?;
    let activations = states.into_iter().map(|count| count.max(0) as usize).sum();
    let mocaps = file.integers("body_mocapid", file.rows("body_parentid"))?;
    let mocaps = mocaps.into_iter().filter(|&place| place >= 0).count();
    let qpos = rows("key_qpos", file.rows("qpos0"))?;
    let qvel = rows("key_qvel", file.rows("dof_armature"))?;
    let act = rows("key_act", activations)?;
    let ctrl = rows("key_ctrl", actuators)?;
    let mocap_pos = rows("key_mpos", 3 * mocaps)?;
    let mocap_quat = rows("key_mquat", 4 * mocaps)?;
    let all = names.into_iter().enumerate().map(|(k, name)| Keyframe {
        name,
        qpos: qpos[k].clone(),
        qvel: qvel[k].clone(),
        act: act[k].clone(),
        ctrl: ctrl[k].clone(),
        mocap_pos: mocap_pos[k].clone(),
        mocap_quat: mocap_quat[k].clone(),
    });
    Ok(all.collect())
}
