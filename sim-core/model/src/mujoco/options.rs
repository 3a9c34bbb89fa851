//! Options of a model: where it is placed, and what its `<option>` becomes in a scene.

use super::format::ModelFile;
use crate::description::{Description, Solver};
use crate::error::ModelError;
use crate::geom_contact::ContactOverride;
use crate::pose::Pose;
use crate::softness::Softness;
use sim_physics::constants::contact::Cone;
use sim_physics::constants::options::Integrator;

/// The flag by which all contacts have the parameters of `<option>`.
pub(super) const OVERRIDE: &str = "mjENBL_OVERRIDE";

/// How a model is read.
#[derive(Clone, Debug, PartialEq)]
pub struct MujocoOptions {
    /// Name of the robot.
    pub name: String,
    /// Frame of the model's world in the scene's.
    pub pose: Pose,
    /// Most vertices of a mesh's convex hull.
    pub max_hull_vertices: usize,
}

impl MujocoOptions {
    /// Vertices of a hull by default: more than nearly all published hulls have.
    pub const HULL_VERTICES: usize = 1024;

    /// A robot of this name at the origin.
    pub fn named(name: &str) -> MujocoOptions {
        MujocoOptions {
            name: name.to_owned(),
            pose: Pose::identity(),
            max_hull_vertices: MujocoOptions::HULL_VERTICES,
        }
    }
}

/// Is this flag of `option/flag` set against its default? Flags that disable begin with `mjDSBL_`.
pub(super) fn has_flag(file: &ModelFile, flag: &str) -> Result<bool, ModelError> {
    Ok(file.texts("opt.flags")?.iter().any(|set| set == flag))
}

/// What all contacts of a model have in place of their own parameters (MuJoCo: `o_margin`, `o_solref`, `o_solimp` and
/// `o_friction`).
pub(super) fn contact_override(file: &ModelFile) -> Result<Option<ContactOverride>, ModelError> {
    if !has_flag(file, OVERRIDE)? {
        return Ok(None);
    }
    let [slide, across, twist, roll, roll_across] = file.vectors("opt.o_friction", 1)?[0];
    Ok(Some(ContactOverride {
        softness: Softness {
            solref: file.vectors("opt.o_solref", 1)?[0],
            solimp: file.vectors("opt.o_solimp", 1)?[0],
        },
        friction: [slide, twist, roll],
        second: [across, roll_across],
        margin: file.real("opt.o_margin")?,
    }))
}

/// The integrator. Refusals have named the others.
pub(super) fn integrator(file: &ModelFile) -> Result<Integrator, ModelError> {
    Ok(
        match file.texts("opt.integrator")?.first().map(String::as_str) {
            Some("mjINT_IMPLICITFAST") => Integrator::ImplicitFast,
            Some("mjINT_IMPLICIT") => Integrator::Implicit,
            Some("mjINT_RK4") => Integrator::RungeKutta,
            _ => Integrator::Euler,
        },
    )
}

/// An empty scene with the options of a model.
pub(super) fn scene(file: &ModelFile) -> Result<Description, ModelError> {
    let mut scene = Description::new(file.real("opt.timestep")?, 1);
    let gravity = file.vectors::<3>("opt.gravity", 1)?[0];
    scene.gravity = match has_flag(file, "mjDSBL_GRAVITY")? {
        true => [0.0; 3],
        false => gravity,
    };
    let count = |name: &str| -> Result<usize, ModelError> {
        let value = file.integer(name)?;
        usize::try_from(value)
            .ok()
            .filter(|&count| count > 0)
            .ok_or_else(|| file.fault(format!("{name} is {value}; give at least 1")))
    };
    scene.solver = Solver {
        iterations: count("opt.iterations")?,
        ls_iterations: count("opt.ls_iterations")?,
        tolerance: file.real("opt.tolerance")?,
        cone: match file.texts("opt.cone")?.first().map(String::as_str) {
            Some("mjCONE_PYRAMIDAL") => Cone::Pyramidal,
            _ => Cone::Elliptic,
        },
        impratio: file.real("opt.impratio")?,
    };
    Ok(scene)
}
