//! Robots of a scene file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sim_model::geometry::MeshOptions;
use sim_model::{ModelError, Robot, TargetMode, UrdfOptions};

use super::number::{Number, PerDof};
use super::pose::{no_rotation, pose};
use super::summary::driven;
use super::surface::given;

fn hull_vertices() -> usize {
    MeshOptions::default().max_hull_vertices
}

/// A robot from a URDF file. Joint values are one number for all dofs, or a list with one per dof.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotTable {
    /// Its name in the scene; left out, it is the name in its file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its URDF file.
    pub urdf: PathBuf,
    /// Folders that hold the packages of `package://` paths.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub package_dirs: Vec<PathBuf>,
    /// Position of the root link in the world [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation of the root link in the world, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
    /// Whether the root link moves freely.
    #[serde(default)]
    pub floating: bool,
    /// Whether an inertia that no body can have is refused; otherwise it is balanced, with a warning.
    #[serde(default)]
    pub strict: bool,
    /// Most vertices of the convex hull of a collision mesh, 8 to 1024.
    #[serde(default = "hull_vertices")]
    pub mesh_max_hull_vertices: usize,
    /// Whether a concave collision mesh becomes several convex hulls.
    #[serde(default)]
    pub convex_decomposition: bool,
    /// Whether the `<up_axis>` of COLLADA meshes is applied; RViz leaves it out.
    #[serde(default)]
    pub collada_up_axis: bool,
    /// Whether its own links touch each other.
    #[serde(default)]
    pub self_collisions: bool,
    /// Coefficient of sliding friction of all its shapes; left out, 1 [–].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mu: Option<Number>,
    /// Contact stiffness, as Newton's shape `ke`; left out, 2500.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ke: Option<Number>,
    /// Contact damping, as Newton's shape `kd`; left out, 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kd: Option<Number>,
    /// Friction damping, as Newton's shape `kf`; left out, 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kf: Option<Number>,
    /// Distance at which contact forces begin; left out, 0 [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Number>,
    /// How much farther out contacts are listed, without a force; left out, 0 [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Number>,
    /// Directions in which a contact acts: 1 along the normal, 3 with sliding friction; left out, 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condim: Option<usize>,
    /// Newton's collision group: 0 touches nothing, a positive one itself and the negative ones, a negative one all but
    /// itself; left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<i32>,
    /// Positions at the start [rad or m]; left out, 0. Unless a list says otherwise, mimic joints start where their leaders put them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_q: Option<PerDof<Number>>,
    /// Position targets at the start [rad or m]; left out, the positions at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_target_q: Option<PerDof<Number>>,
    /// Velocity targets at the start [rad/s or m/s]; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_target_qd: Option<PerDof<Number>>,
    /// Errors the drives act on; left out, position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_target_mode: Option<PerDof<ModeName>>,
    /// Proportional gains [N·m/rad or N/m]; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_target_ke: Option<PerDof<Number>>,
    /// Derivative gains [N·m·s/rad or N·s/m]; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_target_kd: Option<PerDof<Number>>,
    /// Largest drive efforts [N·m or N], `inf` for no limit; left out, those of the URDF file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_effort_limit: Option<PerDof<Number>>,
    /// Stiffness of the joint limits [N·m/rad or N/m], as Newton's `limit_ke`; left out, 10000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_limit_ke: Option<PerDof<Number>>,
    /// Damping of the joint limits [N·m·s/rad or N·s/m], as Newton's `limit_kd`; left out, 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_limit_kd: Option<PerDof<Number>>,
    /// Inertia of the drives [kg·m² or kg]; left out, 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_armature: Option<PerDof<Number>>,
}

/// Errors a drive acts on, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ModeName {
    /// ke (q* − q) − kd q̇.
    Position,
    /// kd (q̇* − q̇).
    Velocity,
    /// ke (q* − q) + kd (q̇* − q̇).
    Both,
}

impl RobotTable {
    /// How its file is read; relative paths are looked for in `base_dir`.
    pub(super) fn options(&self, base_dir: &Path) -> UrdfOptions {
        UrdfOptions {
            name: self.name.clone(),
            pose: pose(&self.pos, &self.quat),
            floating: self.floating,
            strict: self.strict,
            self_collisions: self.self_collisions,
            meshes: MeshOptions {
                max_hull_vertices: self.mesh_max_hull_vertices,
                convex_decomposition: self.convex_decomposition,
                collada_up_axis: self.collada_up_axis,
            },
            package_dirs: self
                .package_dirs
                .iter()
                .map(|dir| base_dir.join(dir))
                .collect(),
        }
    }

    /// Gives all shapes of its file what is given here of a surface.
    pub(super) fn set_surfaces(&self, robot: &mut Robot) {
        for link in &mut robot.links {
            for collision in &mut link.collisions {
                given!(self).write(&mut collision.surface);
            }
        }
    }

    pub(super) fn set_joints(&self, robot: &mut Robot) -> Result<(), ModelError> {
        type Setter = fn(&mut Robot, &[f64]) -> Result<(), ModelError>;
        let fields: [(&Option<PerDof<Number>>, Setter); 8] = [
            (&self.joint_target_q, Robot::set_joint_target_q),
            (&self.joint_target_qd, Robot::set_joint_target_qd),
            (&self.joint_target_ke, Robot::set_joint_target_ke),
            (&self.joint_target_kd, Robot::set_joint_target_kd),
            (&self.joint_effort_limit, Robot::set_joint_effort_limit),
            (&self.joint_limit_ke, Robot::set_joint_limit_ke),
            (&self.joint_limit_kd, Robot::set_joint_limit_kd),
            (&self.joint_armature, Robot::set_joint_armature),
        ];
        let driven = driven(robot);
        let coords = vec![true; robot.coord_names().len()];
        if let Some(values) = &self.joint_q {
            robot.set_joint_q(&values.spread(&coords, 0.0, |value| value.0))?;
        }
        // a list gives followers values of their own, a single value does not
        if let Some(PerDof::All(_)) = self.joint_q {
            robot.start_followers();
        }
        for (values, set) in fields {
            if let Some(values) = values {
                set(robot, &values.spread(&driven, 0.0, |value| value.0))?;
            }
        }
        if let Some(PerDof::All(_)) = self.joint_target_q {
            robot.aim_followers();
        }
        if let Some(PerDof::All(_)) = self.joint_target_qd {
            robot.pace_followers();
        }
        if let Some(modes) = &self.joint_target_mode {
            robot.set_joint_target_mode(&modes.spread(&driven, TargetMode::Position, |mode| {
                match mode {
                    ModeName::Position => TargetMode::Position,
                    ModeName::Velocity => TargetMode::Velocity,
                    ModeName::Both => TargetMode::Both,
                }
            }))?;
        }
        Ok(())
    }
}
