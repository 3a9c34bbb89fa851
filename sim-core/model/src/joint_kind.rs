//! The motions that joints allow, with the names of their coordinates and dofs.

/// The motion a joint allows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// None: the child is part of its parent.
    #[default]
    Fixed,
    /// Rotation about the axis; URDF's `continuous` is one without a range.
    Revolute,
    /// Translation along the axis.
    Prismatic,
    /// Any rotation about the joint frame's origin. Its velocity is in the child's axes.
    Ball,
    /// Two translations across the axis, then a rotation about it. They are along the joint frame's x and y, rotated with
    /// its z to the axis the short way (after half a turn about x, where the axis points down).
    Planar,
    /// Any motion in the world. Position and quaternion of the child's frame; velocity of its centre of
    /// mass, then angular velocity, in world axes.
    Free,
}

impl JointKind {
    /// Names of its position coordinates; empty where there is just one.
    pub const fn coord_names(self) -> &'static [&'static str] {
        match self {
            JointKind::Fixed => &[],
            JointKind::Revolute | JointKind::Prismatic => &[""],
            JointKind::Ball => &["qx", "qy", "qz", "qw"],
            JointKind::Planar => &["x", "y", "angle"],
            JointKind::Free => &["x", "y", "z", "qx", "qy", "qz", "qw"],
        }
    }

    /// Names of its dofs; empty where there is just one.
    pub const fn dof_names(self) -> &'static [&'static str] {
        match self {
            JointKind::Fixed => &[],
            JointKind::Revolute | JointKind::Prismatic => &[""],
            JointKind::Ball => &["wx", "wy", "wz"],
            JointKind::Planar => &["x", "y", "angle"],
            JointKind::Free => &["vx", "vy", "vz", "wx", "wy", "wz"],
        }
    }

    /// Its position at rest: zeros, and the unit quaternion.
    pub fn rest(self) -> Vec<f64> {
        let mut q = vec![0.0; self.coord_names().len()];
        if let (JointKind::Ball | JointKind::Free, Some(w)) = (self, q.last_mut()) {
            *w = 1.0;
        }
        q
    }
}
