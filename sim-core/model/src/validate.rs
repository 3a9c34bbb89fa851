//! Checks of a description: everything a model relies on, refused by name.

use super::checks::{count, finite, in_range, name, not_negative, positive, unique, within};
use super::description::{Collision, Description, Joint, JointDof, JointKind, Link, Robot, Shape};
use super::error::ModelError;
use super::inertia::{negative_moment, triangle_excess};
use super::pose::{Pose, QUAT_SLACK};

/// Largest ratio of frictional and normal impedance [–].
const IMPRATIO_MAX: f64 = 1e5;
/// Longest physics step [s]: longer ones are a slip of units.
const DT_MAX: f64 = 1.0;
/// Most physics steps in a control frame.
const SUBSTEPS_MAX: usize = 10_000;
/// Most iterations of the solver or its line search.
const ITERATIONS_MAX: usize = 10_000;
/// Most dofs of one robot: a chain of them compiles in half a second.
const ROBOT_DOFS_MAX: usize = 512;
/// Most dofs of all robots of a scene: its dense inverse at the reference pose takes a second.
const SCENE_DOFS_MAX: usize = 2048;
/// Most contacts that a world has room for: of a heap of a thousand boxes.
const CONTACTS_MAX: usize = 4096;
/// Most rows of contacts: four for each, which is a pyramid's.
const ROWS_MAX: usize = 4 * CONTACTS_MAX;
/// Largest length [m]: f32 keeps a tenth of a metre there.
const LENGTH_MAX: f64 = 1e6;
/// Largest mass [kg]: ten of the largest ships.
const MASS_MAX: f64 = 1e10;
/// Largest entry of an inertia [kg·m²]: a kilometre of them.
const INERTIA_MAX: f64 = 1e16;
/// Largest gain, damping, friction, armature, and entry of a mimic, each in its unit: products of three stay within f32.
const FACTOR_MAX: f64 = 1e12;
/// Largest end of a range [rad or m]: its square stays within f32.
const RANGE_MAX: f64 = 1e18;
/// How far an axis' length may be from 1: roundings only, the reader normalises.
const AXIS_SLACK: f64 = 1e-6;

impl Description {
    /// Checks everything that `compile` relies on.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        let (dt, substeps) = (self.dt, self.substeps);
        in_range(
            "dt",
            dt,
            0.0 < dt && dt <= DT_MAX,
            "it must be above 0 and at most 1 s, such as 1/480",
        )?;
        count(
            "substeps",
            substeps,
            SUBSTEPS_MAX,
            "it must be between 1 and 10000",
        )?;
        for (axis, &value) in ["x", "y", "z"].iter().zip(&self.gravity) {
            finite(&format!("gravity {axis}"), value)?;
        }
        let solver = &self.solver;
        count(
            "solver iterations",
            solver.iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        count(
            "solver ls_iterations",
            solver.ls_iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        not_negative("solver tolerance", solver.tolerance)?;
        positive("solver impratio", solver.impratio)?;
        let rule = "give at most 1e5: beyond, single precision has no digits left for the bodies";
        within("solver impratio", solver.impratio, IMPRATIO_MAX, rule)?;

        let robots = self.robots.iter().map(|robot| robot.name.as_str());
        unique("scene", "robot", robots).map_err(|(_, error)| error)?;
        let shapes = self.shapes.iter().map(|shape| shape.name.as_str());
        unique("scene", "shape", shapes).map_err(|(_, error)| error)?;
        for shape in &self.shapes {
            name("shape", &shape.name)?;
            let what = format!("shape `{}`", shape.name);
            pose(&what, &shape.pose)?;
            shape_sizes(&what, &shape.shape)?;
            shape.surface.validate(&what)?;
        }
        if let Some(contacts) = self.contacts_max {
            let rule = "it must be between 1 and 4096";
            count("contacts_max", contacts, CONTACTS_MAX, rule)?;
        }
        if let Some(rows) = self.rows_max {
            count("rows_max", rows, ROWS_MAX, "it must be between 1 and 16384")?;
        }
        let dofs = self.robots.iter().map(Robot::dof_count).sum();
        few("the scene".to_owned(), dofs, SCENE_DOFS_MAX)?;
        self.robots.iter().try_for_each(Robot::validate)?;
        self.validate_shape_names()?;
        self.validate_sensors()?;
        self.param_draws().map(drop)
    }
}

/// What a fault of a robot is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Culprit {
    Robot,
    /// By its index.
    Link(usize),
    /// By its index.
    Joint(usize),
}

/// What is wrong with a robot, and where.
#[derive(Debug)]
pub(super) struct Fault {
    pub culprit: Culprit,
    pub error: Box<ModelError>,
}

impl Culprit {
    /// An error as a fault of this.
    pub fn blame(self, error: ModelError) -> Fault {
        Fault {
            culprit: self,
            error: Box::new(error),
        }
    }
}

impl Robot {
    /// Checks one robot on its own.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.find_fault().map_err(|fault| *fault.error)
    }

    /// The first thing that is wrong, and where.
    pub(super) fn find_fault(&self) -> Result<(), Fault> {
        self.validate_whole()
            .map_err(|error| Culprit::Robot.blame(error))?;
        let owner = format!("robot `{}`", self.name);
        let links = self.links.iter().map(|link| link.name.as_str());
        unique(&owner, "link", links).map_err(|(i, error)| Culprit::Link(i).blame(error))?;
        let joints = self.joints.iter().map(|joint| joint.name.as_str());
        unique(&owner, "joint", joints).map_err(|(i, error)| Culprit::Joint(i).blame(error))?;
        for (i, link) in self.links.iter().enumerate() {
            self.validate_link(&owner, link)
                .map_err(|error| Culprit::Link(i).blame(error))?;
        }
        self.validate_tree()?;
        for (i, joint) in self.joints.iter().enumerate() {
            self.validate_joint(&owner, joint)
                .map_err(|error| Culprit::Joint(i).blame(error))?;
        }
        self.validate_free()?;
        self.validate_moving_mass()?;
        // joints `a.x` and the x of a planar joint `a` would be one
        let dofs = self.dof_names();
        unique(&owner, "dof", dofs.iter().map(String::as_str))
            .map_err(|(_, error)| Culprit::Robot.blame(error))
    }

    /// Name, place and number of dofs.
    fn validate_whole(&self) -> Result<(), ModelError> {
        name("robot", &self.name)?;
        if self.name.contains('/') {
            let rule = "a slash separates robot and joint in `robot/joint`; leave it out";
            return Err(ModelError::BadName {
                what: "robot",
                name: self.name.clone(),
                rule,
            });
        }
        let owner = format!("robot `{}`", self.name);
        pose(&owner, &self.pose)?;
        few(owner, self.dof_count(), ROBOT_DOFS_MAX)
    }

    fn dof_count(&self) -> usize {
        let dofs = |joint: &Joint| joint.kind.dof_names().len();
        self.joints.iter().map(dofs).sum()
    }

    fn validate_link(&self, owner: &str, link: &Link) -> Result<(), ModelError> {
        name("link", &link.name)?;
        let what = format!("{owner}: link `{}`", link.name);
        if let Some(inertial) = &link.inertial {
            let mass = format!("{what}: mass");
            not_negative(&mass, inertial.mass)?;
            within(&mass, inertial.mass, MASS_MAX, "give at most 1e10 kg")?;
            length(&format!("{what}: centre of mass"), inertial.pos)?;
            for value in inertial.inertia.into_iter().flatten() {
                let rule = "give at most 1e16 kg·m²";
                within(&format!("{what}: inertia"), value, INERTIA_MAX, rule)?;
            }
            let (robot, link) = (self.name.clone(), link.name.clone());
            if let Some(moment) = negative_moment(inertial.inertia) {
                return Err(ModelError::NegativeInertia {
                    robot,
                    link,
                    moment,
                });
            }
            if let Some(ratio) = triangle_excess(inertial.inertia) {
                return Err(ModelError::InertiaTriangle { robot, link, ratio });
            }
        }
        for (index, collision) in link.collisions.iter().enumerate() {
            let what = collision_name(&what, index, collision);
            pose(&what, &collision.pose)?;
            shape_sizes(&what, &collision.shape)?;
            collision.surface.validate(&what)?;
            if collision.shape == Shape::Plane {
                return Err(ModelError::PlaneBorne { what });
            }
        }
        Ok(())
    }

    fn validate_joint(&self, owner: &str, joint: &Joint) -> Result<(), ModelError> {
        name("joint", &joint.name)?;
        let what = format!("{owner}: joint `{}`", joint.name);
        let (coords, dofs) = (joint.kind.coord_names().len(), joint.kind.dof_names().len());
        if joint.q.len() != coords || joint.dofs.len() != dofs {
            return Err(ModelError::JointParts {
                what,
                kind: joint.kind,
                coords,
                dofs,
            });
        }
        pose(&what, &joint.origin)?;
        if !joint.moves() {
            return Ok(());
        }
        if !matches!(joint.kind, JointKind::Ball | JointKind::Free) {
            self.validate_axis(&what, joint)?;
        }
        if let Some([lower, upper]) = joint.range {
            let rule = "give at most 1e18, or delete both ends where there is no limit";
            within(&format!("{what}: lower limit"), lower, RANGE_MAX, rule)?;
            within(&format!("{what}: upper limit"), upper, RANGE_MAX, rule)?;
            if lower > upper {
                let (robot, joint) = (self.name.clone(), joint.name.clone());
                return Err(ModelError::EmptyRange {
                    robot,
                    joint,
                    lower,
                    upper,
                });
            }
        }
        not_negative(
            &format!("{what}: velocity limit"),
            joint.velocity_limit.unwrap_or(0.0),
        )?;
        for (dof, part) in joint.dofs.iter().zip(joint.kind.dof_names()) {
            let what = match part.is_empty() {
                true => what.clone(),
                false => format!("{what}, {part}"),
            };
            validate_dof(&what, dof)?;
        }
        for &value in &joint.q {
            finite(&format!("{what}: joint_q"), value)?;
        }
        if let (JointKind::Ball | JointKind::Free, Some(quat)) = (joint.kind, joint.q.last_chunk())
        {
            let start = Pose {
                pos: [0.0; 3],
                quat: *quat,
            };
            pose(&format!("{what}: joint_q"), &start)?;
        }
        self.validate_mimic(&what, joint)
    }

    /// A joint's axis is a unit vector.
    fn validate_axis(&self, what: &str, joint: &Joint) -> Result<(), ModelError> {
        for value in joint.axis {
            finite(&format!("{what}: axis"), value)?;
        }
        let length = joint
            .axis
            .iter()
            .map(|part| part * part)
            .sum::<f64>()
            .sqrt();
        if length == 0.0 {
            return Err(ModelError::ZeroAxis {
                robot: self.name.clone(),
                joint: joint.name.clone(),
            });
        }
        let is_unit = (length - 1.0).abs() <= AXIS_SLACK;
        in_range(
            &format!("{what}: length of the axis"),
            length,
            is_unit,
            "it must be 1",
        )?;
        Ok(())
    }

    fn validate_mimic(&self, what: &str, joint: &Joint) -> Result<(), ModelError> {
        let Some(mimic) = joint.mimic else {
            return Ok(());
        };
        let refuse = |leader: String, reason| {
            Err(ModelError::MimicLeader {
                robot: self.name.clone(),
                joint: joint.name.clone(),
                leader,
                reason,
            })
        };
        let Some(leader) = self.joints.get(mimic.joint) else {
            return refuse(format!("#{}", mimic.joint), "does not exist");
        };
        if leader.name == joint.name {
            return refuse(leader.name.clone(), "is itself");
        }
        if !leader.moves() {
            return refuse(leader.name.clone(), "is fixed");
        }
        if joint.kind.dof_names().len() > 1 || leader.kind.dof_names().len() > 1 {
            return refuse(
                leader.name.clone(),
                "cannot be followed, since one of them has several dofs",
            );
        }
        if leader.mimic.is_some() {
            return refuse(leader.name.clone(), "follows another joint itself");
        }
        let offsets = |dof: &JointDof| dof.offset_q.or(dof.offset_qd).is_some();
        if joint.dofs.iter().any(offsets) {
            return Err(ModelError::FollowerOffset {
                robot: self.name.clone(),
                joint: joint.name.clone(),
                leader: leader.name.clone(),
            });
        }
        let rule = "give at most 1e12, followed leaders multiplied in";
        let multiplier = format!("{what}: mimic multiplier");
        within(&multiplier, mimic.multiplier, FACTOR_MAX, rule)?;
        within(
            &format!("{what}: mimic offset"),
            mimic.offset,
            FACTOR_MAX,
            rule,
        )
    }
}

/// What resists and drives a dof is finite and not negative.
fn validate_dof(what: &str, dof: &JointDof) -> Result<(), ModelError> {
    not_negative(
        &format!("{what}: effort limit"),
        dof.effort_limit.unwrap_or(0.0),
    )?;
    let factors = [
        ("damping", dof.damping),
        ("friction", dof.friction),
        ("joint_armature", dof.armature),
        ("joint_target_ke", dof.target_ke),
        ("joint_target_kd", dof.target_kd),
    ];
    for (field, value) in factors {
        let field = format!("{what}: {field}");
        not_negative(&field, value)?;
        within(&field, value, FACTOR_MAX, "give at most 1e12")?;
    }
    let target_q = dof.target_q.unwrap_or(0.0);
    finite(&format!("{what}: joint_target_q"), target_q)?;
    finite(&format!("{what}: joint_target_qd"), dof.target_qd)?;
    let offsets = [("joint_q", dof.offset_q), ("joint_qd", dof.offset_qd)];
    offsets.iter().try_for_each(|(field, offset)| match offset {
        Some(offset) => offset.validate(&format!("{what}: offset of {field}")),
        None => Ok(()),
    })
}

/// Refuses a frame with a number that is not finite, or a quaternion that is no rotation.
pub(super) fn pose(what: &str, pose: &Pose) -> Result<(), ModelError> {
    length(&format!("{what}: position"), pose.pos)?;
    for value in pose.quat {
        finite(&format!("{what}: quaternion"), value)?;
    }
    let length = pose.quat_length();
    if (length - 1.0).abs() > QUAT_SLACK {
        return Err(ModelError::Quaternion {
            what: what.to_owned(),
            length,
        });
    }
    Ok(())
}

/// A collision by its name, or by its place in its link.
pub(super) fn collision_name(owner: &str, index: usize, collision: &Collision) -> String {
    match &collision.name {
        Some(name) => format!("{owner}: collision `{name}`"),
        None => format!("{owner}: collision {index}"),
    }
}

/// Refuses more dofs than a model can have.
fn few(owner: String, dofs: usize, most: usize) -> Result<(), ModelError> {
    if dofs > most {
        return Err(ModelError::TooManyDofs { owner, dofs, most });
    }
    Ok(())
}

/// Refuses lengths beyond what a scene can hold.
fn length<const N: usize>(what: &str, values: [f64; N]) -> Result<(), ModelError> {
    let rule = "give at most 1e6 m";
    let mut values = values.into_iter();
    values.try_for_each(|value| within(what, value, LENGTH_MAX, rule))
}

/// Refuses sizes that are not positive.
fn size<const N: usize>(what: &str, values: [f64; N]) -> Result<(), ModelError> {
    values
        .into_iter()
        .try_for_each(|value| positive(what, value))?;
    length(what, values)
}

/// Refuses sizes that are not positive or too large.
pub(super) fn shape_sizes(what: &str, shape: &Shape) -> Result<(), ModelError> {
    match *shape {
        Shape::Plane => Ok(()),
        Shape::Box { half_extents } => {
            size(&format!("{what}: half extent of the box"), half_extents)
        }
        Shape::Sphere { radius } => size(&format!("{what}: radius of the sphere"), [radius]),
        Shape::Cylinder {
            radius,
            half_height,
        }
        | Shape::Capsule {
            radius,
            half_height,
        } => {
            let kind = shape.kind();
            size(&format!("{what}: radius of the {kind}"), [radius])?;
            size(&format!("{what}: half height of the {kind}"), [half_height])
        }
        // checked when it was read
        Shape::Mesh(_) => Ok(()),
    }
}
