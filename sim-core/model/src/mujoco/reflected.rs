//! What actuators add to the joint or tendon that they drive (MuJoCo: `actuator_armature`, `actuator_damping`).
//!
//! ```text
//! armature += g² a        damping += g² (d, a, b)         g: the first gear; the velocity is that of the joint or tendon
//! ```
//!
//! All dofs of a ball or a free joint have the same share. It stays where actuators are switched off. So a model with it has
//! the bits of one whose joints and tendons have these numbers themselves.

use super::format::ModelFile;
use super::options::has_flag;
use crate::error::ModelError;

/// What actuators drive.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Driven {
    Joint,
    Tendon,
}

/// What actuators add to a joint or a tendon.
#[derive(Clone, Copy, Default, PartialEq)]
pub(super) struct Share {
    /// [kg·m² or kg]
    pub armature: f64,
    /// [N·m·s/rad or N·s/m]
    pub damping: f64,
    /// By which the damping grows with the speed and its square.
    pub damping_curve: [f64; 2],
}

impl Share {
    /// A curve with what actuators add to it.
    pub fn damped(&self, [a, b]: [f64; 2]) -> [f64; 2] {
        let [more, most] = self.damping_curve;
        [a + more, b + most]
    }
}

/// In MuJoCo's table, a joint or tendon that no actuator adds to.
const NONE: i64 = -1;
/// One that several actuators add to.
const SEVERAL: i64 = -2;

/// The shares of all joints or all tendons. Older versions of MuJoCo have none.
pub(super) fn shares(
    file: &ModelFile,
    driven: Driven,
    count: usize,
) -> Result<Vec<Share>, ModelError> {
    let mut shares = vec![Share::default(); count];
    if !file.has("actuator_armature") {
        return Ok(shares);
    }
    let actuators = file.rows("actuator_trntype");
    let kinds = file.kinds("actuator_trntype", actuators)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", actuators)?;
    let gears = file.vectors::<6>("actuator_gear", actuators)?;
    let armatures = file.reals("actuator_armature", actuators)?;
    let damps = !has_flag(file, "mjDSBL_DAMPER")?;
    let damping = file.reals("actuator_damping", actuators)?;
    let curves = file.curves("actuator_dampingpoly", actuators, false)?;
    let (prefix, names): (_, &[&str]) = match driven {
        Driven::Joint => ("jnt", &["mjTRN_JOINT", "mjTRN_JOINTINPARENT"]),
        Driven::Tendon => ("tendon", &["mjTRN_TENDON"]),
    };
    // the compiler's choice: numbers that a program sets later count only there
    let givers = file.integers_or(&format!("{prefix}_actuatorid"), count, SEVERAL)?;
    for k in (0..actuators).filter(|&k| names.contains(&kinds[k].as_str())) {
        let target = usize::try_from(targets[k][0]).ok();
        let Some(place) = target.filter(|&place| place < count) else {
            continue;
        };
        if givers[place] == NONE || (givers[place] != SEVERAL && givers[place] != k as i64) {
            continue;
        }
        let square = gears[k][0] * gears[k][0];
        let share = &mut shares[place];
        share.armature += square * armatures[k];
        if damps {
            share.damping += square * damping[k];
            let more = curves[k].map(|number| square * number);
            share.damping_curve = share.damped(more);
        }
    }
    Ok(shares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::tensor::{Dtype, TensorView, serialize};

    /// A model with two joints and a tendon: two actuators on joint 0, one on joint 1, one on the tendon, one on a site.
    fn file(givers: [i32; 2], flags: &str) -> ModelFile {
        let ints = |all: &[i32]| {
            all.iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        let reals = |all: &[f64]| {
            all.iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<u8>>()
        };
        let gears: Vec<f64> = [3.0, -2.0, 0.5, 2.0, 9.0]
            .iter()
            .flat_map(|&gear| [gear, 7.0, 7.0, 7.0, 7.0, 7.0])
            .collect();
        let kinds = b"mjTRN_JOINT\0mjTRN_JOINTINPARENT\0mjTRN_TENDON\0mjTRN_SITE\0".to_vec();
        let tensors = [
            ("format", Dtype::I32, vec![1], ints(&[1])),
            (
                "opt.flags",
                Dtype::U8,
                vec![flags.len()],
                flags.as_bytes().to_vec(),
            ),
            (
                "actuator_trntype",
                Dtype::I32,
                vec![5],
                ints(&[0, 1, 0, 2, 3]),
            ),
            (
                "actuator_trntype.names",
                Dtype::U8,
                vec![kinds.len()],
                kinds,
            ),
            (
                "actuator_trnid",
                Dtype::I32,
                vec![5, 2],
                ints(&[0, -1, 0, -1, 1, -1, 0, -1, 0, -1]),
            ),
            ("actuator_gear", Dtype::F64, vec![5, 6], reals(&gears)),
            (
                "actuator_armature",
                Dtype::F64,
                vec![5],
                reals(&[1.0, 2.0, 4.0, 8.0, 16.0]),
            ),
            (
                "actuator_damping",
                Dtype::F64,
                vec![5],
                reals(&[1.0, 1.0, 8.0, 2.0, 3.0]),
            ),
            (
                "actuator_dampingpoly",
                Dtype::F64,
                vec![5, 2],
                reals(&[1.0; 10]),
            ),
            ("jnt_actuatorid", Dtype::I32, vec![2], ints(&givers)),
            ("tendon_actuatorid", Dtype::I32, vec![1], ints(&[3])),
        ];
        let views = tensors.iter().map(|(name, kind, shape, bytes)| {
            let view = TensorView::new(*kind, shape.clone(), bytes).expect("bytes of its shape");
            (*name, view)
        });
        let name = format!(
            "reflected-{}-{givers:?}-{}",
            std::process::id(),
            flags.len()
        );
        let path = std::env::temp_dir().join(name);
        let bytes = serialize(views, None).expect("arrays of their shapes");
        std::fs::write(&path, bytes).expect("a folder for files");
        let file = ModelFile::read(&path).expect("whole");
        std::fs::remove_file(&path).expect("it was written");
        file
    }

    #[test]
    fn joints_and_tendons_get_the_square_of_the_gear() {
        let file = file([SEVERAL as i32, 2], "");
        let joints = shares(&file, Driven::Joint, 2).expect("whole");
        // 9 · 1 + 4 · 2, and 9 + 4
        assert_eq!([joints[0].armature, joints[0].damping], [17.0, 13.0]);
        assert_eq!(joints[0].damping_curve, [13.0; 2]);
        assert_eq!([joints[1].armature, joints[1].damping], [1.0, 2.0]);
        let tendons = shares(&file, Driven::Tendon, 1).expect("whole");
        assert_eq!([tendons[0].armature, tendons[0].damping], [32.0, 8.0]);
    }

    #[test]
    fn actuators_that_the_compiler_did_not_count_add_nothing() {
        let file = file([1, NONE as i32], "");
        let joints = shares(&file, Driven::Joint, 2).expect("whole");
        assert_eq!([joints[0].armature, joints[0].damping], [8.0, 4.0]);
        assert!(joints[1] == Share::default());
    }

    #[test]
    fn without_dampers_only_armature_is_left() {
        let file = file([SEVERAL as i32, 2], "mjDSBL_DAMPER\0");
        let joints = shares(&file, Driven::Joint, 2).expect("whole");
        assert_eq!([joints[0].armature, joints[0].damping], [17.0, 0.0]);
        assert_eq!(joints[0].damping_curve, [0.0; 2]);
    }
}
