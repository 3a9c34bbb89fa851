//! From a description to a model: checked, sorted, immutable.
//!
//! - Links that are fixed to each other become one body.
//! - The frame of a joint with an axis is rotated so that the axis is z.
//! - A planar joint becomes two slides and a hinge.
//! - Constraint parameters that derive from mass are evaluated at the reference pose q = 0.

mod actuators;
mod bodies;
mod carrier;
mod constraint_rows;
mod contacts;
mod inverse_weight;
mod keyframes;
mod masses;
mod mocaps;
mod output_frames;
mod param_starts;
mod passive;
mod precompiled;
mod ray_meshes;
mod scans;
mod sensors;
mod sites;
mod solver;
mod tendons;
mod ties;

use crate::description::Description;
use crate::error::ModelError;
use crate::model::{Model, Start};
use bodies::BodyBuilder;
use constraint_rows::{IMPEDANCE, VaryingRows, add_rows};
use contacts::add_contacts;
use contacts::pieces::{PlacedShape, Rules, placed_shapes};
use contacts::sensors::add_contact_sensors;
use inverse_weight::Reference;
use precompiled::{
    check_models, output_site_names, output_tendon_names, sensors_of_centers, take_inverse_weights,
};
use ray_meshes::add_ray_meshes;
use sensors::finish_sensors;
use sim_physics::constants::actuators::Actuators;
use sim_physics::constants::contact::Contacts;
use sim_physics::constants::options::{Integrator, Newton};
use sim_physics::constants::outputs::OutputFrames;
use sim_physics::constants::params::{Param, Varying};
use sim_physics::constants::passive::GravityCompensation;
use sim_physics::constants::sensors::Sensors;
use sim_physics::constants::springs::Springs;
use sim_physics::constants::{Constants, Coupled, Delay, Dof};
use solver::{classes_of_roots, is_damped, newton, noslip, precompiled_parts, search};
use std::collections::BTreeSet;
use std::sync::Arc;
use ties::add_ties;

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

fn compile(scene: &Description) -> Result<Model, ModelError> {
    let mut builder = BodyBuilder::from_scene(scene);
    let mut m = bodies_alone(scene, &mut builder)?;
    let mut reference = inverse_weight::at_reference(&m, &builder.dof_names)?;
    take_inverse_weights(scene, &builder.robots, &mut reference);
    m.solver = newton(scene, &m, &builder, &reference);
    let varies = |param| scene.params.contains(&param);
    let varying = VaryingRows {
        friction: varies(Param::JointFriction),
        limits: varies(Param::JointLimitLower) || varies(Param::JointLimitUpper),
    };
    add_rows(
        &mut m,
        &builder.joints,
        &reference.dof_inverse_weight,
        varying,
    );
    add_forces(&mut m, scene, &mut builder);
    let ties = add_ties(&mut m, std::mem::take(&mut builder.constraints));
    finish_sensors(&mut m.sensors, builder.static_moment, &ties);
    check_models(scene)?;
    add_integrator(&mut m, scene);
    let placed = placed_shapes(scene, &builder.carriers, &m);
    let rules = Rules::new(scene, &builder.carriers, &m, &reference);
    m.solver.noslip = noslip(scene, &m, reference.mean_inertia);
    add_contacts(&mut m, scene, &placed, &rules)?;
    m.contacts.ordered_corners = m.solver.noslip.is_some();
    if let Some(search) = &mut m.solver.search {
        search.classes = classes_of_roots(&search.roots, &m.contacts);
    }
    m.scans = scene.placed_scans(&builder.carriers, &m.contacts)?;
    add_contact_sensors(&mut m, scene, &placed, &rules);
    add_ray_meshes(&mut m, scene);
    add_params(&mut m, scene, &builder, &placed, &reference)?;
    model(scene, m, builder, reference)
}

/// A model of bodies and joints that nothing acts on, which is all that inertias at the reference pose need.
fn bodies_alone(
    scene: &Description,
    builder: &mut BodyBuilder,
) -> Result<Constants<f64>, ModelError> {
    let pattern = builder.pattern();
    let mass_entries = builder.mass_entries(&pattern);
    let of_dofs: BTreeSet<usize> = mass_entries.iter().map(|entry| entry.place).collect();
    let mass_zeros = (0..pattern.len()).filter(|place| !of_dofs.contains(place));
    let varies = |param| scene.params.contains(&param);
    let resists = |d: &Dof<f64>| d.damping + d.kd > 0.0 || d.damping_curve != [0.0; 2];
    let damped = builder.dofs.iter().any(resists)
        || varies(Param::JointDamping)
        || varies(Param::JointTargetKd);
    Ok(Constants {
        dt: scene.dt,
        gravity: scene.gravity,
        mass_zeros: mass_zeros.collect(),
        mass_entries,
        pattern,
        sites: scene.placed_sites(&builder.carriers, &builder.bodies)?,
        bodies: std::mem::take(&mut builder.bodies),
        damped,
        diagonal_dofs: (0..builder.dofs.len()).collect(),
        dofs: std::mem::take(&mut builder.dofs),
        trees: std::mem::take(&mut builder.trees),
        frames: std::mem::take(&mut builder.frames),
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
            noslip: None,
        },
        varying: Varying::default(),
        delay: Delay::default(),
        scans: Vec::new(),
        integrator: Integrator::default(),
        tendons: Vec::new(),
        springs: Springs::default(),
        free_joints: Vec::new(),
        solved_bodies: Vec::new(),
        gyroscopic_bodies: Vec::new(),
        drags: Vec::new(),
        fluid_geoms: Vec::new(),
        compensation: GravityCompensation::default(),
        ties: Vec::new(),
        tie_of_row: Vec::new(),
        switches: 0,
        actuators: Actuators::default(),
        mocaps: 0,
        outputs: OutputFrames::default(),
        sensors: Sensors::default(),
    })
}

/// What acts on the bodies besides gravity, commands and constraints, and what is measured of them.
fn add_forces(m: &mut Constants<f64>, scene: &Description, builder: &mut BodyBuilder) {
    m.tendons = std::mem::take(&mut builder.tendons);
    m.springs = std::mem::take(&mut builder.springs);
    m.free_joints = std::mem::take(&mut builder.free_joints);
    m.drags = std::mem::take(&mut builder.drags);
    m.fluid_geoms = std::mem::take(&mut builder.fluid_geoms);
    m.compensation = std::mem::take(&mut builder.compensation);
    m.switches = builder.switches;
    m.actuators = std::mem::take(&mut builder.actuators);
    m.mocaps = builder.mocaps;
    m.outputs = std::mem::take(&mut builder.outputs);
    m.sensors = std::mem::take(&mut builder.sensors);
    passive::keep_acting(m, scene);
}

/// How a step goes on from forces: integrator, what it treats implicitly, and the solver's path.
fn add_integrator(m: &mut Constants<f64>, scene: &Description) {
    let first = precompiled_parts(scene).next();
    if let Some(parts) = first {
        m.integrator = parts.integrator;
        m.solver.search = search(scene, &m.bodies);
    }
    passive::add_implicit(m, scene);
    if let Some(parts) = first {
        m.damped = is_damped(m, parts.implicit_damping);
    }
}

/// What differs from world to world.
fn add_params(
    m: &mut Constants<f64>,
    scene: &Description,
    builder: &BodyBuilder,
    placed: &[PlacedShape<'_>],
    reference: &Reference,
) -> Result<(), ModelError> {
    let starts = param_starts::starts(scene, m, &builder.joints, placed, reference)?;
    for &param in &scene.params {
        let numbers = param.starts(m, &starts);
        m.varying.add(param, numbers);
    }
    if scene.params.contains(&Param::CommandDelay) && !m.dofs.is_empty() {
        m.delay = Delay {
            frames: scene.delay_max().div_ceil(scene.substeps),
            substeps: scene.substeps,
        };
    }
    if masses::vary(scene) {
        let built = builder.robots.iter().zip(&builder.carriers);
        for (robot, (range, carriers)) in scene.robots.iter().zip(built) {
            masses::add_parts(m, scene, robot, range.bodies.start, carriers);
        }
    }
    Ok(())
}

/// The model of these constants, with its names.
fn model(
    scene: &Description,
    constants: Constants<f64>,
    builder: BodyBuilder,
    reference: Reference,
) -> Result<Model, ModelError> {
    let actuators = builder.actuator_names.iter().zip(&constants.actuators.all);
    let activations = actuators.filter(|(_, actuator)| actuator.activation.is_some());
    let keyframes = keyframes::states(
        &scene.robots,
        &builder.robots,
        &constants.bodies,
        &builder.start,
        [
            builder.actuator_names.len(),
            constants.actuators.activations,
        ],
    );
    let mut model = Model {
        dt: scene.dt,
        substeps: scene.substeps,
        shape_names: scene.shape_names(),
        activation_names: activations.map(|(name, _)| name.clone()).collect(),
        keyframes,
        constants,
        dof_names: builder.dof_names,
        coord_names: builder.coord_names,
        body_names: builder.body_names,
        mocap_names: builder.mocap_names,
        equality_names: builder.equality_names,
        contact_pair_names: builder.contact_pair_names,
        actuator_names: builder.actuator_names,
        sensors: builder.sensor_infos,
        refused_sensors: [builder.refused_sensors, sensors_of_centers(scene)].concat(),
        site_names: scene.sites.iter().map(|site| site.name.clone()).collect(),
        output_site_names: output_site_names(scene),
        output_tendon_names: output_tendon_names(scene),
        contact_sensors: scene.sensed_shapes()?,
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
