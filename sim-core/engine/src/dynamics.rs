//! Kinematics and dynamics of a model at states that a caller gives, apart from any simulation.
//!
//! It runs the physics code of [`sim_physics::step`] in double precision. States are evaluated; nothing moves.

use crate::backend::{BackendError, Lanes, Precision, Values};
use crate::simulation::{Options, Simulation};
use sim_model::Model;
use sim_physics::arrays::Field;
use sim_physics::constants::Dof;
use std::sync::Arc;

/// Fields that [`Dynamics`] evaluates; each depends on positions and velocities only.
pub const EVALUATES: [Field; 5] = [
    Field::BodyQ,
    Field::BodyQd,
    Field::BodyJacobian,
    Field::MassMatrix,
    Field::BiasForce,
];

/// Evaluates fields of a model at given states.
pub struct Dynamics {
    model: Arc<Model>,
    /// One world per set of fields that was requested.
    worlds: Vec<World>,
}

struct World {
    simulation: Simulation,
    /// A frame, 8-byte words.
    arena: Vec<u64>,
    /// Zero velocities. `(dofs)`
    still: Vec<f64>,
}

impl Dynamics {
    /// For a model.
    pub fn new(model: Arc<Model>) -> Dynamics {
        Dynamics {
            model,
            worlds: Vec::new(),
        }
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// A field at given states. `(states, …)` as the field table says, in its unit.
    ///
    /// `joint_q` is `(states, coords)`, `joint_qd` `(states, dofs)`, or empty for zero velocities.
    /// Quaternions are normalized.
    ///
    /// # Errors
    /// A field that is not in [`EVALUATES`], lengths that do not fit, a value that is not finite, a quaternion of
    /// length 0; "world" in the message counts the states.
    pub fn evaluate(
        &mut self,
        field: Field,
        joint_q: &[f64],
        joint_qd: &[f64],
    ) -> Result<Vec<f64>, BackendError> {
        if !EVALUATES.contains(&field) {
            return Err(BackendError::Group {
                field: field.row().name,
                expected: "a function of positions and velocities",
                choices: EVALUATES.map(|field| field.row().name).join(", "),
            });
        }
        let states = self.states(joint_q)?;
        self.fits(Field::JointQd, joint_qd, states, true)?;
        let mut values = Vec::with_capacity(states * field.elements(&self.model.sizes()));
        let world = self.world(&[field])?;
        for state in 0..states {
            world.place(state, joint_q, joint_qd)?;
            values.extend(world.field(field));
        }
        Ok(values)
    }

    /// Link frames in the world: position, quaternion (x, y, z, w). `(states, bodies, 7)` [m, –]
    ///
    /// # Errors
    /// As [`Dynamics::evaluate`].
    pub fn forward_kinematics(&mut self, joint_q: &[f64]) -> Result<Vec<f64>, BackendError> {
        self.evaluate(Field::BodyQ, joint_q, &[])
    }

    /// Joint forces that give the accelerations `joint_qdd`: `M q̈ + c`, and `+ d q̇` with `damping`. `(states, dofs)`
    /// [N·m or N]
    ///
    /// M has the armature in it, c is [`Field::BiasForce`], d the joint's damping at its speed. Damping of a free joint
    /// is exact where it is linear and the centre of mass is the origin of the frame. Drives, dry friction, limits, mimic
    /// joints and contacts are left out. `joint_qd` and `joint_qdd` are `(states, dofs)`, or empty for zeros. Sent as
    /// `joint_f`, the result makes a joint without these accelerate by `joint_qdd`.
    ///
    /// # Errors
    /// As [`Dynamics::evaluate`].
    pub fn inverse_dynamics(
        &mut self,
        joint_q: &[f64],
        joint_qd: &[f64],
        joint_qdd: &[f64],
        damping: bool,
    ) -> Result<Vec<f64>, BackendError> {
        let states = self.states(joint_q)?;
        self.fits(Field::JointQd, joint_qd, states, true)?;
        self.fits(Field::JointQdd, joint_qdd, states, true)?;
        let model = Arc::clone(&self.model);
        let dofs = model.dofs();
        let mut forces = Vec::with_capacity(states * dofs);
        let world = self.world(&[Field::MassMatrix, Field::BiasForce])?;
        for state in 0..states {
            world.place(state, joint_q, joint_qd)?;
            let row = state * dofs..(state + 1) * dofs;
            let qdd = joint_qdd.get(row.clone()).unwrap_or(&[]);
            let qd = joint_qd.get(row).unwrap_or(&[]);
            let mut matrix = world.field(Field::MassMatrix);
            for (dof, bias) in world.field(Field::BiasForce).enumerate() {
                let row = matrix.by_ref().take(dofs);
                // all of the row is taken, also where nothing accelerates
                let inertial: f64 = row
                    .enumerate()
                    .map(|(k, m)| m * qdd.get(k).copied().unwrap_or(0.0))
                    .sum();
                let passive = match (damping, qd.get(dof)) {
                    (true, Some(qd)) => {
                        let Dof {
                            damping,
                            damping_curve: [a, b],
                            ..
                        } = model.constants().dofs[dof];
                        (damping + a * qd.abs() + b * qd * qd) * qd
                    }
                    _ => 0.0,
                };
                forces.push(inertial + bias + passive);
            }
        }
        Ok(forces)
    }

    /// Number of states in an array of positions.
    fn states(&self, joint_q: &[f64]) -> Result<usize, BackendError> {
        // a model without joints has one state
        let coords = self.model.coords();
        let states = joint_q.len().checked_div(coords).unwrap_or(1).max(1);
        self.fits(Field::JointQ, joint_q, states, false)?;
        Ok(states)
    }

    /// Refuses an array of another length than `states` rows, and values that are not finite.
    fn fits(
        &self,
        field: Field,
        values: &[f64],
        states: usize,
        may_be_empty: bool,
    ) -> Result<(), BackendError> {
        let columns = field.elements(&self.model.sizes());
        if values.len() != states * columns && !(may_be_empty && values.is_empty()) {
            return Err(BackendError::Length {
                field: field.row().name,
                got: values.len(),
                expected: states * columns,
                worlds: states,
                columns,
            });
        }
        match values.iter().position(|value| !value.is_finite()) {
            Some(place) => Err(BackendError::NotFinite {
                field: field.row().name,
                world: place / columns,
                name: match field {
                    Field::JointQ => self.model.coord_names()[place % columns].clone(),
                    _ => self.model.dof_names()[place % columns].clone(),
                },
                value: values[place],
            }),
            None => Ok(()),
        }
    }

    /// The world that evaluates these fields.
    fn world(&mut self, fields: &[Field]) -> Result<&mut World, BackendError> {
        let has = |world: &World| {
            let slots = &world.simulation.layout().slots;
            fields
                .iter()
                .zip(slots)
                .all(|(field, slot)| slot.field == *field)
        };
        let place = match self.worlds.iter().position(has) {
            Some(place) => place,
            None => {
                let options = Options {
                    worlds: 1,
                    precision: Precision::F64,
                    threads: Some(1),
                    lanes: Lanes::Auto,
                    fields: fields.to_vec(),
                    ..Options::default()
                };
                let simulation = Simulation::new(Arc::clone(&self.model), &options)?;
                let arena = vec![0; simulation.layout().bytes.div_ceil(8)];
                let still = vec![0.0; self.model.dofs()];
                self.worlds.push(World {
                    simulation,
                    arena,
                    still,
                });
                self.worlds.len() - 1
            }
        };
        Ok(&mut self.worlds[place])
    }
}

impl World {
    /// Evaluates the fields at a state; no velocities mean zero.
    fn place(
        &mut self,
        state: usize,
        joint_q: &[f64],
        joint_qd: &[f64],
    ) -> Result<(), BackendError> {
        let model = self.simulation.model();
        let (coords, dofs) = (model.coords(), model.dofs());
        let q = &joint_q[state * coords..(state + 1) * coords];
        let named = |error| match error {
            BackendError::Quaternion { name, .. } => {
                BackendError::Quaternion { name, world: state }
            }
            other => other,
        };
        self.simulation
            .write(Field::JointQ, 0..coords, Values::F64(q), None)
            .map_err(named)?;
        let qd = joint_qd.get(state * dofs..(state + 1) * dofs);
        self.simulation.write(
            Field::JointQd,
            0..dofs,
            Values::F64(qd.unwrap_or(&self.still)),
            None,
        )?;
        self.simulation.forward(&mut self.arena);
        Ok(())
    }

    /// Values of a field at the state that was evaluated last.
    fn field(&self, field: Field) -> impl Iterator<Item = f64> {
        let mut slots = self.simulation.layout().slots.iter();
        let slot = slots
            .find(|slot| slot.field == field)
            .expect("a world evaluates what it was made for");
        let words = slot.offset / 8..(slot.offset + slot.bytes) / 8;
        self.arena[words].iter().map(|&word| f64::from_bits(word))
    }
}
