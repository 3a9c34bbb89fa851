//! From a description to a model: checked, sorted, immutable.
//!
//! - Links that are fixed to each other become one body.
//! - The frame of a joint with an axis is rotated so that the axis is z.
//! - A planar joint becomes two slides and a hinge.
//! - Constraint parameters that derive from mass are evaluated at the reference pose q = 0.

mod actuators;
mod bodies;
mod carrier;
mod clusters;
mod constraint_rows;
mod contact_memory;
mod contact_pairs;
mod contact_pieces;
mod contacts;
mod fields;
mod inverse_weight;
mod keyframes;
mod masses;
mod mocaps;
mod mujoco_contacts;
mod mujoco_frames;
mod mujoco_sensors;
mod passive;
mod scans;
mod sites;
mod ties;

use crate::description::{Description, Robot};
use crate::error::ModelError;
use crate::model::{Model, RobotRange, Start};
use bodies::BodyBuilder;
use constraint_rows::{IMPEDANCE, add_rows};
use contact_pieces::{Rules, connected, placed_shapes};
use contacts::add_contacts;
use inverse_weight::Reference;
use sim_physics::constants::actuators::{Actuator, Actuators};
use sim_physics::constants::contact::Contacts;
use sim_physics::constants::options::{Integrator, Newton, Search};
use sim_physics::constants::outputs::OutputFrames;
use sim_physics::constants::params::{Param, SceneStarts, Varying};
use sim_physics::constants::passive::GravityCompensation;
use sim_physics::constants::sensors::Sensors;
use sim_physics::constants::springs::Springs;
use sim_physics::constants::{Body, Constants, Coupled, Delay};
use std::collections::BTreeSet;
use std::sync::Arc;

impl Description {
    /// Checks and freezes the scene.
    ///
    /// # Errors
    /// Whatever [`Description::validate`] finds, and a mass matrix that is not positive definite.
    pub fn compile(&self) -> Result<Arc<Model>, ModelError> {
        self.validate()?;
        let mut scene = self.clone();
        // a drawn parameter differs from world to world
        scene.params.extend(self.param_ranges.keys());
        compile(&scene).map(Arc::new)
    }
}

/// Past this `f32` accelerations are refined. Rounding moved them by at most 5e-5 of their largest in 1400 states of
/// random trees below it, by up to 6e-4 between it and 1000, and by 1e-3 at 4000.
const LOCKED_OVER_FREE_MAX: f64 = 100.0;

fn compile(scene: &Description) -> Result<Model, ModelError> {
    let mut builder = BodyBuilder::default();
    builder.dt = scene.dt;
    for robot in &scene.robots {
        builder.add(robot);
    }
    let pattern = builder.pattern();
    let mass_entries = builder.mass_entries(&pattern);
    let kept: BTreeSet<usize> = mass_entries.iter().map(|entry| entry.place).collect();
    let mass_zeros = (0..pattern.len()).filter(|place| !kept.contains(place));
    let mass_zeros = mass_zeros.collect();
    let sites = scene.placed_sites(&builder.carriers, &builder.bodies)?;
    let mut constants = Constants {
        dt: scene.dt,
        gravity: scene.gravity,
        pattern,
        bodies: builder.bodies,
        damped: builder.dofs.iter().any(|d| d.damping + d.kd > 0.0)
            || [Param::JointDamping, Param::JointTargetKd]
                .iter()
                .any(|p| scene.params.contains(p)),
        dofs: builder.dofs,
        trees: builder.trees,
        frames: builder.frames,
        mass_entries,
        mass_zeros,
        coords: builder.coord_names.len(),
        equalities: Vec::new(),
        frictions: Vec::new(),
        limits: Vec::new(),
        coupled: Coupled::default(),
        contacts: Contacts::none(scene.solver.cone, scene.solver.impratio),
        contact_impedance: IMPEDANCE,
        solver: Newton {
            iterations: scene.solver.iterations,
            ls_iterations: scene.solver.ls_iterations,
            tolerance: 0.0,
            refinements: 0,
            search: None,
        },
        varying: Varying::default(),
        delay: Delay::default(),
        sites,
        scans: Vec::new(),
        integrator: Integrator::default(),
        springs: Springs::default(),
        free_joints: Vec::new(),
        drags: Vec::new(),
        compensation: GravityCompensation::default(),
        ties: Vec::new(),
        tie_of_row: Vec::new(),
        switches: 0,
        actuators: Actuators::default(),
        mocaps: 0,
        outputs: OutputFrames::default(),
        sensors: Sensors::default(),
    };
    let mut reference = inverse_weight::at_reference(&constants, &builder.dof_names)?;
    take_inverse_weights(scene, &builder.robots, &mut reference);
    // MuJoCo scales costs by 1 / (mean inertia × dofs)
    constants.solver.tolerance =
        scene.solver.tolerance * reference.mean_inertia * constants.dofs.len() as f64;
    let mut locked_over_free = reference.locked_over_free;
    if scene.params.contains(&Param::JointArmature) {
        // armatures hide what the links do to each other, and a world may have none
        let mut bare = constants.clone();
        bare.dofs.iter_mut().for_each(|dof| dof.armature = 0.0);
        let bare = inverse_weight::at_reference(&bare, &builder.dof_names);
        let without = bare.map_or(f64::INFINITY, |bare| bare.locked_over_free);
        locked_over_free = locked_over_free.max(without);
    }
    // a pass takes an error of 1e-3 to 1e-6, one of 1e-1 to 1e-2 or 1e-3
    constants.solver.refinements = [1.0, 100.0, 1000.0]
        .iter()
        .filter(|&times| locked_over_free > times * LOCKED_OVER_FREE_MAX)
        .count();
    add_rows(
        &mut constants,
        &builder.joints,
        &reference.dof_inverse_weight,
        scene.params.contains(&Param::JointFriction),
    );
    let of_activations = builder.actuator_names.iter().zip(&builder.actuators.all);
    let activation_names = of_activations
        .filter(|(_, actuator)| actuator.activation.is_some())
        .map(|(name, _)| name.clone())
        .collect();
    constants.springs = builder.springs;
    constants.free_joints = builder.free_joints;
    constants.drags = builder.drags;
    constants.compensation = builder.compensation;
    constants.switches = builder.switches;
    constants.actuators = builder.actuators;
    constants.mocaps = builder.mocaps;
    constants.outputs = builder.outputs;
    constants.sensors = builder.sensors;
    passive::keep_acting(&mut constants, scene);
    let constraint_of_tie = ties::add_ties(&mut constants, builder.constraints);
    mujoco_sensors::finish_sensors(
        &mut constants.sensors,
        builder.static_moment,
        &constraint_of_tie,
    );
    check_models(scene)?;
    let models = || {
        scene
            .robots
            .iter()
            .filter_map(|robot| robot.mujoco.as_ref())
    };
    if let Some(parts) = models().next() {
        constants.integrator = parts.integrator;
        // of several models, what all of them allow
        constants.solver.search = Some(Search {
            tolerance: scene.solver.tolerance,
            ls_tolerance: models()
                .map(|parts| parts.ls_tolerance)
                .fold(f64::INFINITY, f64::min),
            islands: models().all(|parts| parts.islands),
            warm_start: models().all(|parts| parts.warm_start),
            roots: roots(&constants.bodies),
            classes: Vec::new(),
        });
        constants.damped = is_damped(&constants, scene, parts.implicit_damping);
    }
    let shape_names = scene.shape_names();
    let placed = placed_shapes(scene, &builder.carriers, &constants);
    let rules = Rules {
        connected: connected(scene, &builder.carriers, &constants),
        self_collisions: scene.robots.iter().map(|r| r.self_collisions).collect(),
        link_inverse_weight: &reference.link_inverse_weight,
        mujoco: scene.robots.iter().map(|r| r.mujoco.as_deref()).collect(),
    };
    add_contacts(&mut constants, scene, &placed, &rules)?;
    if let Some(search) = &mut constants.solver.search {
        search.classes = classes_of_roots(&search.roots, &constants.contacts);
    }
    constants.scans = scene.placed_scans(&builder.carriers, &constants.contacts)?;
    mujoco_contacts::add_contact_sensors(&mut constants, scene, &placed);
    let surfaces: Vec<f64> = placed.iter().map(|shape| shape.surface.mu).collect();
    let sensors = scene.sensed_shapes()?;
    let starts = SceneStarts {
        mu: surfaces,
        contact_sensors: sensors.len(),
        ..masses::starts(scene)
    };
    for &param in &scene.params {
        let numbers = param.starts(&constants, &starts);
        constants.varying.add(param, numbers);
    }
    if scene.params.contains(&Param::CommandDelay) && !constants.dofs.is_empty() {
        constants.delay = Delay {
            frames: scene.delay_max().div_ceil(scene.substeps),
            substeps: scene.substeps,
        };
    }
    if masses::vary(scene) {
        for (robot, (ours, carriers)) in scene
            .robots
            .iter()
            .zip(builder.robots.iter().zip(&builder.carriers))
        {
            masses::add_parts(&mut constants, scene, robot, ours.bodies.start, carriers);
        }
    }

    let activations = constants.actuators.activations;
    let keyframes = keyframes::states(
        &scene.robots,
        &builder.robots,
        &constants.bodies,
        &builder.start,
        [builder.actuator_names.len(), activations],
    );
    let mut model = Model {
        constants,
        dt: scene.dt,
        substeps: scene.substeps,
        dof_names: builder.dof_names,
        coord_names: builder.coord_names,
        body_names: builder.body_names,
        shape_names,
        activation_names,
        keyframes,
        mocap_names: builder.mocap_names,
        equality_names: builder.equality_names,
        actuator_names: builder.actuator_names,
        sensors: builder.sensor_infos,
        refused_sensors: builder.refused_sensors,
        site_names: scene.sites.iter().map(|site| site.name.clone()).collect(),
        mujoco_site_names: mujoco_site_names(scene),
        contact_sensors: sensors,
        command_delay_max: scene.delay_max(),
        robots: builder.robots,
        start: Start {
            params: scene.param_draws()?,
            ..builder.start
        },
        dof_inverse_weight: reference.dof_inverse_weight,
        hash: 0,
    };
    model.hash = model.own_hash();
    Ok(model)
}

/// Names of the sites of MuJoCo models, in the order of their frames.
fn mujoco_site_names(scene: &Description) -> Vec<String> {
    let robots = scene.robots.iter();
    let sites = robots.flat_map(|robot| {
        let parts = robot.mujoco.iter();
        let names = parts.flat_map(|parts| &parts.frames.site_names);
        names.map(|name| format!("{}/{name}", robot.name))
    });
    sites.collect()
}

/// Puts MuJoCo's inverse weights in the place of ours, for the robots that it compiled.
fn take_inverse_weights(scene: &Description, ranges: &[RobotRange], reference: &mut Reference) {
    for (robot, range) in scene.robots.iter().zip(ranges) {
        let Some(parts) = &robot.mujoco else { continue };
        let links = &mut reference.link_inverse_weight[range.bodies.clone()];
        links.copy_from_slice(&parts.link_inverse_weight);
        let dofs = &mut reference.dof_inverse_weight[range.dofs.clone()];
        dofs.copy_from_slice(&parts.dof_inverse_weight);
        if scene.robots.len() == 1 {
            reference.mean_inertia = parts.mean_inertia;
        }
    }
}

/// Of each dof, the first one of its kinematic tree.
fn roots(bodies: &[Body<f64>]) -> Vec<usize> {
    let mut of_dofs: Vec<usize> = Vec::new();
    let mut of_bodies: Vec<Option<usize>> = Vec::new();
    for body in bodies {
        let above = body.parent.and_then(|parent| of_bodies[parent]);
        let dofs = body.motion.dofs();
        let root = above.or((dofs > 0).then_some(body.dof));
        of_bodies.push(root);
        of_dofs.extend(std::iter::repeat_n(root.unwrap_or(body.dof), dofs));
    }
    of_dofs
}

/// Of each dof, the classes of contacts whose first dof is of the tree that begins there.
fn classes_of_roots(roots: &[usize], contacts: &Contacts<f64>) -> Vec<Vec<usize>> {
    let mut classes = vec![Vec::new(); roots.len()];
    for (k, class) in contacts.classes.iter().enumerate() {
        if let Some(column) = class.columns.first() {
            classes[roots[column.dof]].push(k);
        }
    }
    classes
}

/// Refuses models from MuJoCo that do not fit together, or that a parameter would change in silence.
fn check_models(scene: &Description) -> Result<(), ModelError> {
    let models = scene.robots.iter().filter(|robot| robot.mujoco.is_some());
    let options = |robot: &Robot| {
        let parts = robot.mujoco.as_ref()?;
        Some((
            parts.integrator,
            parts.implicit_damping,
            parts.safe_references,
        ))
    };
    let models: Vec<&Robot> = models.collect();
    if let Some(two) = models
        .windows(2)
        .find(|two| options(two[0]) != options(two[1]))
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "models `{}` and `{}` have different integrators, eulerdamp or refsafe; make them equal",
                two[0].name, two[1].name
            ),
        });
    }
    let has_pairs = |robot: &&Robot| {
        let parts = robot.mujoco.as_ref();
        parts.is_some_and(|parts| !parts.pairs.is_empty())
    };
    if let Some(robot) = models.iter().copied().find(has_pairs)
        && scene.params.contains(&Param::ShapeMu)
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "shape_mu cannot vary: pairs of model `{}` have friction of their own; remove the pairs",
                robot.name
            ),
        });
    }
    let drags = |robot: &&Robot| {
        let parts = robot.mujoco.as_ref();
        parts.is_some_and(|parts| !parts.drags.is_empty())
    };
    let massive = [Param::BodyMass, Param::BodyInertia];
    if let Some(robot) = models.iter().copied().find(drags)
        && let Some(param) = massive.iter().find(|param| scene.params.contains(param))
    {
        return Err(ModelError::MujocoRefused {
            reasons: format!(
                "{} cannot vary: density and viscosity act on boxes with the masses and inertias of model `{}`; \
                 vary body_mass_scale, or set both to 0",
                param.row().name,
                robot.name
            ),
        });
    }
    let geoms = models.iter().flat_map(|robot| &robot.links);
    let geoms = geoms.flat_map(|link| &link.collisions);
    let priorities: BTreeSet<i64> = geoms
        .filter_map(|collision| Some(collision.geom.as_ref()?.priority))
        .collect();
    if priorities.len() > 1 && scene.params.contains(&Param::ShapeMu) {
        return Err(ModelError::MujocoRefused {
            reasons: "shape_mu cannot vary: geoms have different priorities, which decide whose friction counts; \
                      make them equal"
                .to_owned(),
        });
    }
    Ok(())
}

/// Whether a step of a scene with MuJoCo's options is implicit in any damping.
fn is_damped(m: &Constants<f64>, scene: &Description, implicit_damping: bool) -> bool {
    let varies = [Param::ActuatorGain, Param::ActuatorBias];
    let varies = varies.iter().any(|param| scene.params.contains(param));
    let of_actuators =
        |actuator: &Actuator<f64>| varies || actuator.gain[2] != 0.0 || actuator.bias[2] != 0.0;
    match m.integrator {
        Integrator::Euler => m.damped && implicit_damping,
        Integrator::RungeKutta => false,
        Integrator::ImplicitFast => {
            let tendons = &m.springs.tendons;
            m.damped
                || !m.free_joints.is_empty()
                || !m.drags.is_empty()
                || m.actuators.all.iter().any(of_actuators)
                || tendons.iter().any(|tendon| tendon.damping != 0.0)
        }
    }
}
