//! A scene as it is simulated: checked, balanced, with the constants that its model has, for `Scene.to_mujoco`.

use std::path::Path;

use serde_json::{Value, json};
use sim_model::{Description, Joint, JointKind, Link, Model, Pose, Robot, Shape};
use sim_physics::constants::Soft;
use sim_physics::constants::contact::{Cone, pair};

use super::error::ConfigError;
use super::scene::SceneFile;

impl SceneFile {
    /// The scene as it is simulated; paths as in [`SceneFile::describe`].
    ///
    /// Links of `robots` come parents first, each with its `name`, `joint`, `inertial` (`null` without mass), and `shapes`.
    /// Shapes have one piece, a mesh one per hull; `pairs` are of pieces, `[shape, piece]` each. Stiffness [1/s²] and
    /// damping [1/s] are those of `aref = -b v - k imp pos`. Quaternions are (x, y, z, w).
    ///
    /// # Errors
    /// As [`SceneFile::describe`], and a scene that does not compile.
    pub fn compiled(&self, base_dir: &Path) -> Result<Value, ConfigError> {
        let description = self.describe(base_dir)?;
        let model = description.compile()?;
        let names = description.shape_names();
        let mut names = names.into_iter();
        let fixed: Vec<Value> = (description.shapes.iter())
            .zip(&mut names)
            .map(|(fixed_shape, name)| shape(&name, &fixed_shape.pose, &fixed_shape.shape))
            .collect();
        let mut first = [0, 0];
        let robots: Vec<Value> = (description.robots.iter())
            .map(|described| robot(described, &mut names, &mut first))
            .collect();
        let solver = &description.solver;
        let start = model.start();
        Ok(json!({
            "dt": description.dt,
            "gravity": description.gravity,
            "iterations": solver.iterations,
            "ls_iterations": solver.ls_iterations,
            "tolerance": solver.tolerance,
            "pyramidal": solver.cone == Cone::Pyramidal,
            "impratio": solver.impratio,
            "shapes": fixed,
            "robots": robots,
            "sites": sites(&description),
            "dof_names": model.dof_names(),
            "joint_q": start.joint_q,
            "joint_target_q": start.joint_target_q,
            "joint_target_qd": start.joint_target_qd,
            "dofs": dofs(&model),
            "limits": limits(&model),
            "frictions": frictions(&model),
            "equalities": equalities(&model),
            "pairs": pairs(&model),
        }))
    }
}

/// A robot; its shapes take the next names, its joints the next dofs and coordinates.
fn robot(robot: &Robot, names: &mut impl Iterator<Item = String>, first: &mut [usize; 2]) -> Value {
    let mut links = Vec::new();
    for index in robot.link_order() {
        let link: &Link = &robot.links[index];
        let carrying = robot.joints.iter().find(|joint| joint.child == index);
        let shapes: Vec<Value> = (link.collisions.iter())
            .zip(&mut *names)
            .map(|(collision, name)| shape(&name, &collision.pose, &collision.shape))
            .collect();
        links.push(json!({
            "name": link.name,
            "joint": carrying.map(|joint| joint_of(robot, joint, first)),
            "inertial": link.inertial.as_ref().map(|inertial| json!({
                "mass": inertial.mass, "pos": inertial.pos, "inertia": inertial.inertia,
            })),
            "shapes": shapes,
        }));
    }
    json!({
        "name": robot.name,
        "pos": robot.pose.pos,
        "quat": robot.pose.quat,
        "from_mujoco": robot.precompiled.is_some(),
        "links": links,
    })
}

fn joint_of(robot: &Robot, joint: &Joint, [dof, coord]: &mut [usize; 2]) -> Value {
    let told = json!({
        "name": joint.name,
        "kind": match joint.kind {
            JointKind::Fixed => "fixed",
            JointKind::Revolute => "hinge",
            JointKind::Prismatic => "slide",
            JointKind::Ball => "ball",
            JointKind::Planar => "planar",
            JointKind::Free => "free",
        },
        "parent": joint.parent.map(|parent| robot.links[parent].name.as_str()),
        "pos": joint.origin.pos,
        "quat": joint.origin.quat,
        "axis": joint.axis,
        "dof": *dof,
        "coord": *coord,
    });
    *dof += joint.dofs.len();
    *coord += joint.q.len();
    told
}

fn shape(name: &str, pose: &Pose, shape: &Shape) -> Value {
    let (kind, size) = match shape {
        Shape::Plane => ("plane", json!(null)),
        Shape::Box { half_extents } => ("box", json!(half_extents)),
        Shape::Sphere { radius } => ("sphere", json!([radius])),
        Shape::Cylinder {
            radius,
            half_height,
        } => ("cylinder", json!([radius, half_height])),
        Shape::Capsule {
            radius,
            half_height,
        } => ("capsule", json!([radius, half_height])),
        Shape::Ellipsoid { radii } => ("ellipsoid", json!(radii)),
        Shape::Mesh(mesh) => {
            let hulls = mesh.hulls.iter().map(|hull| &hull.vertices);
            ("mesh", json!(hulls.collect::<Vec<_>>()))
        }
        Shape::HeightField(field) => (
            "hfield",
            json!({
                "rows": field.rows,
                "columns": field.columns,
                "half": field.half,
                "bottom": field.bottom,
                "elevations": field.elevations,
            }),
        ),
    };
    json!({ "name": name, "pos": pose.pos, "quat": pose.quat, "kind": kind, "size": size })
}

fn sites(description: &Description) -> Vec<Value> {
    let sites = description.sites.iter();
    sites
        .map(|site| {
            json!({ "name": site.name, "body": site.body, "pos": site.pose.pos, "quat": site.pose.quat })
        })
        .collect()
}

fn dofs(model: &Model) -> Vec<Value> {
    let dofs = model.constants().dofs.iter();
    dofs.map(|dof| {
        json!({
            "armature": dof.armature,
            "damping": dof.damping,
            "ke": dof.ke,
            "kd": dof.kd,
            "follows_position": dof.follows_position,
            "follows_velocity": dof.follows_velocity,
            "effort_limit": dof.effort_limit,
        })
    })
    .collect()
}

/// Stiffness and damping as MuJoCo's direct `solref`, which is divided by the largest impedance.
fn solref(stiffness: f64, damping: f64, d_max: f64) -> [f64; 2] {
    [-stiffness * d_max * d_max, -damping * d_max]
}

fn limits(model: &Model) -> Vec<Value> {
    let reference = |soft: &Soft<f64>| solref(soft.stiffness, soft.damping, soft.impedance.d_max);
    let limits = model.constants().limits.iter();
    limits
        .map(|limit| {
            json!({ "dof": limit.dof, "range": [limit.lower, limit.upper], "solref": reference(&limit.soft) })
        })
        .collect()
}

fn frictions(model: &Model) -> Vec<Value> {
    let frictions = model.constants().frictions.iter();
    frictions
        .map(|friction| json!({ "dof": friction.dof, "loss": friction.loss }))
        .collect()
}

fn equalities(model: &Model) -> Vec<Value> {
    let equalities = model.constants().equalities.iter();
    equalities
        .map(|equality| {
            json!({
                "follower": equality.follower,
                "leader": equality.leader,
                "multiplier": equality.multiplier,
                "offset": equality.offset,
            })
        })
        .collect()
}

fn pairs(model: &Model) -> Vec<Value> {
    let constants = model.constants();
    let contacts = &constants.contacts;
    let (numbers, indices) = (contacts.handles.pair_numbers, contacts.handles.pair_indices);
    let d_max = constants.contact_impedance.d_max;
    let piece = |solid: usize| {
        let shape = contacts.solids[solid].shape;
        let first = contacts
            .solids
            .iter()
            .position(|other| other.shape == shape);
        [shape, solid - first.unwrap_or(solid)]
    };
    (0..contacts.pairs.len())
        .map(|p| {
            let number = |k: usize| contacts.tables.numbers[numbers.base + p * numbers.stride + k];
            let index =
                |k: usize| contacts.tables.indices[indices.base + p * indices.stride + k] as usize;
            json!({
                "pieces": [piece(index(pair::SOLID_A)), piece(index(pair::SOLID_B))],
                "condim": if number(pair::RUBS) == 0.0 { 1 } else { 3 },
                "mu": number(pair::MU),
                "margin": number(pair::MARGIN),
                "gap": number(pair::REACH) - number(pair::MARGIN),
                "solref": solref(number(pair::STIFFNESS), number(pair::DAMPING), d_max),
                "solreffriction": solref(number(pair::STIFFNESS), number(pair::SLIDING), d_max),
            })
        })
        .collect()
}
