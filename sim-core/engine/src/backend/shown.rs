//! Which stages evaluate what a frame shows.

use sim_physics::arrays::{Field, Layout};
use sim_physics::step::{FORWARD, Stage};

/// The leading stages of [`FORWARD`] that the fields need, and link frames and velocities where they are asked for.
pub(super) fn stages_for(layout: &Layout) -> Vec<Stage> {
    let mut last = None;
    let mut output = Vec::new();
    for slot in &layout.slots {
        let (needs, shows): (Stage, &[Stage]) = match slot.field {
            Field::BodyQ => (Stage::Kinematics, &[Stage::Poses]),
            Field::BodyQd | Field::BodyJacobian => (Stage::Bias, &[Stage::Velocities]),
            Field::BiasForce => (Stage::Bias, &[]),
            Field::MassMatrix => (Stage::MassMatrix, &[]),
            Field::SmoothForce => (Stage::Actuation, &[]),
            Field::EfcJ | Field::EfcD | Field::EfcAref => (Stage::Constraint, &[]),
            Field::ContactCount
            | Field::ContactPos
            | Field::ContactNormal
            | Field::ContactDistance
            | Field::ContactPair => (Stage::ContactRows, &[]),
            Field::ConstraintForce
            | Field::EfcForce
            | Field::ContactForce
            | Field::BodyContactForce
            | Field::ContactSensor => (Stage::Refine, &[]),
            Field::JointQdd => (Stage::Accelerations, &[]),
            Field::JointTorque => (Stage::Command, &[Stage::JointTorque]),
            Field::SiteQ | Field::SiteQd => (Stage::Bias, &[Stage::Poses, Stage::Sites]),
            Field::SiteInverseJacobian => (Stage::Kinematics, &[Stage::SiteInverse]),
            Field::Gyro | Field::Accelerometer => (Stage::Accelerations, &[Stage::Imu]),
            _ => continue,
        };
        last = last.max(FORWARD.iter().position(|&stage| stage == needs));
        for &stage in shows {
            if !output.contains(&stage) {
                output.push(stage);
            }
        }
    }
    let mut stages = FORWARD[..last.map_or(0, |last| last + 1)].to_vec();
    stages.extend(output);
    stages
}

/// Is it a field of contacts, which a backend writes from its lists?
pub(super) fn is_of_contacts(field: Field) -> bool {
    matches!(
        field,
        Field::ContactCount
            | Field::ContactPos
            | Field::ContactNormal
            | Field::ContactDistance
            | Field::ContactForce
            | Field::ContactPair
            | Field::BodyContactForce
            | Field::ContactSensor
    )
}
