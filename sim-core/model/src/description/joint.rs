//! Joints as users name them: what motion they allow, and what resists and drives it.

use crate::distribution::Distribution;
use crate::joint_kind::JointKind;
use crate::pose::Pose;

/// What connects a link to its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name, unique in the robot.
    pub name: String,
    /// What motion it allows.
    pub kind: JointKind,
    /// Index of the parent link; `None` is the world, for a floating base.
    pub parent: Option<usize>,
    /// Index of the child link.
    pub child: usize,
    /// Joint frame, which is the child frame at position 0, in the parent frame.
    pub origin: Pose,
    /// Unit vector of the motion in the joint frame, or normal of the plane [–].
    pub axis: [f64; 3],
    /// Lowest and highest position [rad or m]; `None` is without limits. Of joints with one dof only.
    pub range: Option<[f64; 2]>,
    /// Largest speed [rad/s or m/s]; reported, not enforced.
    pub velocity_limit: Option<f64>,
    /// The joint it follows, if any.
    pub mimic: Option<Mimic>,
    /// Position at the start, per coordinate of its kind [rad or m].
    pub q: Vec<f64>,
    /// What resists and drives each of its dofs.
    pub dofs: Vec<JointDof>,
}

/// What resists and drives a dof of a joint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointDof {
    /// Viscous damping [N·m·s/rad or N·s/m].
    pub damping: f64,
    /// Dry friction [N·m or N].
    pub friction: f64,
    /// Inertia of the drive seen at the joint [kg·m² or kg].
    pub armature: f64,
    /// Stiffness of its limits, Newton's `limit_ke` [N·m/rad or N/m]; `None` is Newton's default.
    pub limit_ke: Option<f64>,
    /// Damping of its limits, Newton's `limit_kd` [N·m·s/rad or N·s/m]; `None` is Newton's default.
    pub limit_kd: Option<f64>,
    /// Largest drive effort [N·m or N]; `None` is without limit.
    pub effort_limit: Option<f64>,
    /// Position target at the start [rad or m]; `None` is the start position. A ball's is a rotation vector.
    pub target_q: Option<f64>,
    /// Velocity target at the start [rad/s or m/s].
    pub target_qd: f64,
    /// Which errors the drive acts on.
    pub target_mode: TargetMode,
    /// Proportional gain of the drive [N·m/rad or N/m].
    pub target_ke: f64,
    /// Derivative gain of the drive [N·m·s/rad or N·s/m].
    pub target_kd: f64,
    /// What a reset adds to the start position [rad or m]. For a ball it is a rotation vector in the child's axes, for a
    /// free joint x, y, z, then roll, pitch, yaw about the world's axes. Limits clamp the sum. A follower moves with its
    /// leader instead.
    pub offset_q: Option<Distribution>,
    /// What a reset adds to the start velocity, which is 0 [rad/s or m/s].
    pub offset_qd: Option<Distribution>,
}

impl JointDof {
    /// Newton's default of [`JointDof::limit_ke`] [N·m/rad or N/m].
    pub const LIMIT_KE: f64 = 1.0e4;
    /// Newton's default of [`JointDof::limit_kd`] [N·m·s/rad or N·s/m].
    pub const LIMIT_KD: f64 = 10.0;

    /// Stiffness and damping of its limits.
    pub fn limit_gains(&self) -> [f64; 2] {
        [
            self.limit_ke.unwrap_or(JointDof::LIMIT_KE),
            self.limit_kd.unwrap_or(JointDof::LIMIT_KD),
        ]
    }
}

/// Errors a drive acts on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TargetMode {
    /// ke (q* − q) − kd q̇.
    #[default]
    Position,
    /// kd (q̇* − q̇).
    Velocity,
    /// ke (q* − q) + kd (q̇* − q̇).
    Both,
}

/// q = offset + multiplier · q of the leader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Index of the leader joint, which is itself no follower.
    pub joint: usize,
    /// Factor on the leader's position [–, or m/rad and the like].
    pub multiplier: f64,
    /// Position at the leader's 0 [rad or m].
    pub offset: f64,
}

impl Joint {
    /// A joint between two links, at rest in the parent's frame, about or along x.
    pub fn new(kind: JointKind, name: &str, parent: Option<usize>, child: usize) -> Joint {
        Joint {
            name: name.to_owned(),
            kind,
            parent,
            child,
            origin: Pose::identity(),
            axis: [1.0, 0.0, 0.0],
            range: None,
            velocity_limit: None,
            mimic: None,
            q: kind.rest(),
            dofs: vec![JointDof::default(); kind.dof_names().len()],
        }
    }

    /// A fixed joint between two links.
    pub fn fixed(name: &str, parent: usize, child: usize) -> Joint {
        Joint::new(JointKind::Fixed, name, Some(parent), child)
    }

    /// Whether it has dofs.
    pub fn moves(&self) -> bool {
        self.kind != JointKind::Fixed
    }
}
