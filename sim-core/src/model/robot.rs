//! The dofs of a robot: their order, and setting their start state and drives.

use super::description::{Joint, Robot, TargetMode};
use super::error::ModelError;
use super::validate::{finite, not_negative};

impl Robot {
    /// Link indices, parents before children: depth first, children in the order of their joints in the file.
    ///
    /// Links that hang from no root are left out; `Description::validate` refuses them.
    pub fn link_order(&self) -> Vec<usize> {
        let mut children = vec![Vec::new(); self.links.len()];
        let mut has_parent = vec![false; self.links.len()];
        for joint in &self.joints {
            if joint.parent < self.links.len() && joint.child < self.links.len() {
                children[joint.parent].push(joint.child);
                has_parent[joint.child] = true;
            }
        }
        let mut order = Vec::with_capacity(self.links.len());
        let mut seen = vec![false; self.links.len()];
        let mut stack: Vec<usize> = (0..self.links.len())
            .filter(|&link| !has_parent[link])
            .rev()
            .collect();
        while let Some(link) = stack.pop() {
            if std::mem::replace(&mut seen[link], true) {
                continue;
            }
            order.push(link);
            stack.extend(children[link].iter().rev());
        }
        order
    }

    /// Joint indices of the moving joints in the order of their dofs, which is that of their child links.
    pub fn dofs(&self) -> Vec<usize> {
        let mut joint_of = vec![None; self.links.len()];
        for (index, joint) in self.joints.iter().enumerate() {
            if let Some(slot) = joint_of.get_mut(joint.child) {
                *slot = Some(index);
            }
        }
        self.link_order()
            .into_iter()
            .filter_map(|link| joint_of[link])
            .filter(|&joint| self.joints[joint].moves())
            .collect()
    }

    /// Sets the start positions [rad or m], one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is not finite.
    pub fn set_joint_q(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_q", values, finite, |joint, value| joint.q = value)
    }

    /// Sets the position targets [rad or m] at the start, one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is not finite.
    pub fn set_joint_target_q(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_q", values, finite, |joint, value| {
            joint.target_q = Some(value)
        })
    }

    /// Sets the velocity targets [rad/s or m/s] at the start, one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is not finite.
    pub fn set_joint_target_qd(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_qd", values, finite, |joint, value| {
            joint.target_qd = value
        })
    }

    /// Sets which errors the drives act on, one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs.
    pub fn set_joint_target_mode(&mut self, modes: &[TargetMode]) -> Result<(), ModelError> {
        self.set(
            "joint_target_mode",
            modes,
            |_, _| Ok(()),
            |joint, mode| joint.target_mode = mode,
        )
    }

    /// Sets the proportional gains [N·m/rad or N/m], one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_target_ke(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_ke", values, not_negative, |joint, value| {
            joint.target_ke = value
        })
    }

    /// Sets the derivative gains [N·m·s/rad or N·s/m], one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_target_kd(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_kd", values, not_negative, |joint, value| {
            joint.target_kd = value
        })
    }

    /// Sets the largest drive efforts [N·m or N], one a dof; infinity is without limit.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not a number.
    pub fn set_joint_effort_limit(&mut self, values: &[f64]) -> Result<(), ModelError> {
        let check = |what: &str, value: f64| {
            if value == f64::INFINITY {
                Ok(())
            } else {
                not_negative(what, value)
            }
        };
        self.set("joint_effort_limit", values, check, |joint, value| {
            joint.effort_limit = value.is_finite().then_some(value);
        })
    }

    /// Sets the inertia of the drives [kg·m² or kg], one a dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_armature(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_armature", values, not_negative, |joint, value| {
            joint.armature = value
        })
    }

    /// Checks every value, then writes them all in dof order.
    fn set<T: Copy>(
        &mut self,
        field: &'static str,
        values: &[T],
        check: impl Fn(&str, T) -> Result<(), ModelError>,
        write: impl Fn(&mut Joint, T),
    ) -> Result<(), ModelError> {
        let dofs = self.dofs();
        if values.len() != dofs.len() {
            return Err(ModelError::JointValues {
                robot: self.name.clone(),
                field,
                expected: dofs.len(),
                got: values.len(),
            });
        }
        for (&dof, &value) in dofs.iter().zip(values) {
            check(
                &format!(
                    "robot `{}`: {field} of joint `{}`",
                    self.name, self.joints[dof].name
                ),
                value,
            )?;
        }
        for (&dof, &value) in dofs.iter().zip(values) {
            write(&mut self.joints[dof], value);
        }
        Ok(())
    }
}
