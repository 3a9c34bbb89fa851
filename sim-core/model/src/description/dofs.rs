//! The dofs of a robot: their order and names, and setters of start state and drives.

use super::joint::{Joint, JointDof, TargetMode};
use super::robot::Robot;
use crate::error::ModelError;
use crate::joint_kind::JointKind;
use crate::value_checks::{finite, not_negative};

impl Robot {
    /// Link indices, parents before children: depth first, children in the order of their joints in the file.
    ///
    /// Links that hang from no root are left out; `Description::validate` refuses them.
    pub fn link_order(&self) -> Vec<usize> {
        let mut children = vec![Vec::new(); self.links.len()];
        let mut has_parent = vec![false; self.links.len()];
        for joint in &self.joints {
            let Some(parent) = joint.parent else { continue };
            if parent < self.links.len() && joint.child < self.links.len() {
                children[parent].push(joint.child);
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

    /// Joint indices of the moving joints in the order of their child links, which is that of their dofs.
    pub fn moving_joints(&self) -> Vec<usize> {
        let mut joints_of = vec![Vec::new(); self.links.len()];
        for (index, joint) in self.joints.iter().enumerate() {
            if let Some(joints) = joints_of.get_mut(joint.child) {
                joints.push(index);
            }
        }
        self.link_order()
            .into_iter()
            .flat_map(|link| std::mem::take(&mut joints_of[link]))
            .filter(|&joint| self.joints[joint].moves())
            .collect()
    }

    /// Frees the root link from the world: adds the joint `floating_base`, which starts at the robot's pose.
    ///
    /// Where a joint of the robot has that name, it is `floating_base_2`, and so on.
    pub fn float(&mut self) {
        let taken = |name: &String| self.joints.iter().any(|joint| joint.name == *name);
        let name = (1..)
            .map(|count| match count {
                1 => "floating_base".to_owned(),
                _ => format!("floating_base_{count}"),
            })
            .find(|name| !taken(name))
            .expect("there are more names than joints");
        self.free_root(&name);
    }

    /// Carries the root link by a free joint of this name, which starts at the robot's pose.
    pub(crate) fn free_root(&mut self, joint: &str) {
        let root = self.link_order().first().copied().unwrap_or(0);
        let mut base = Joint::new(JointKind::Free, joint, None, root);
        base.q[..3].copy_from_slice(&self.pose.pos);
        base.q[3..].copy_from_slice(&self.pose.quat);
        self.floating = true;
        self.joints.insert(0, base);
        for mimic in self
            .joints
            .iter_mut()
            .filter_map(|joint| joint.mimic.as_mut())
        {
            mimic.joint += 1;
        }
    }

    /// Starts the free bodies where their joints are, from the robot's pose down: their state is in the world.
    pub(crate) fn place_free_bodies(&mut self) {
        let mut poses = vec![self.pose; self.links.len()];
        let mut above = vec![None; self.links.len()];
        for (index, joint) in self.joints.iter().enumerate() {
            above[joint.child] = joint.parent.map(|parent| (index, parent));
        }
        for link in self.link_order() {
            if let Some((index, parent)) = above[link] {
                let joint = &mut self.joints[index];
                poses[link] = poses[parent].mul(&joint.origin);
                if joint.kind == JointKind::Free {
                    joint.q[..3].copy_from_slice(&poses[link].pos);
                    joint.q[3..].copy_from_slice(&poses[link].quat);
                }
            }
        }
    }

    /// Names of its dofs in order: `joint`, or `joint.part` where a joint has several.
    pub fn dof_names(&self) -> Vec<String> {
        self.names(JointKind::dof_names)
    }

    /// Names of its position coordinates in order.
    pub fn coord_names(&self) -> Vec<String> {
        self.names(JointKind::coord_names)
    }

    fn names(&self, parts: impl Fn(JointKind) -> &'static [&'static str]) -> Vec<String> {
        let mut names = Vec::new();
        for index in self.moving_joints() {
            let joint = &self.joints[index];
            names.extend(parts(joint.kind).iter().map(|part| match part.is_empty() {
                true => joint.name.clone(),
                false => format!("{}.{part}", joint.name),
            }));
        }
        names
    }

    /// Sets the start positions [rad or m] per coordinate.
    ///
    /// # Errors
    /// Another number of values than coordinates, a value that is not finite, or a quaternion that is no rotation.
    pub fn set_joint_q(&mut self, values: &[f64]) -> Result<(), ModelError> {
        let names = self.coord_names();
        self.check("joint_q", &names, values, finite)?;
        let mut rest = values;
        for index in self.moving_joints() {
            let q;
            (q, rest) = rest.split_at(self.joints[index].q.len());
            self.joints[index].q.copy_from_slice(q);
        }
        Ok(())
    }

    /// Sets the position targets [rad or m] at the start, per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is not finite.
    pub fn set_joint_target_q(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_q", values, finite, |dof, value| {
            dof.target_q = Some(value)
        })
    }

    /// Sets the velocity targets [rad/s or m/s] at the start per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is not finite.
    pub fn set_joint_target_qd(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_qd", values, finite, |dof, value| {
            dof.target_qd = value
        })
    }

    /// Sets which errors the drives act on per dof.
    ///
    /// # Errors
    /// Another number of values than dofs.
    pub fn set_joint_target_mode(&mut self, modes: &[TargetMode]) -> Result<(), ModelError> {
        self.set(
            "joint_target_mode",
            modes,
            |_, _| Ok(()),
            |dof, mode| dof.target_mode = mode,
        )
    }

    /// Sets the proportional gains [N·m/rad or N/m] per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_target_ke(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_ke", values, not_negative, |dof, value| {
            dof.target_ke = value
        })
    }

    /// Sets the derivative gains [N·m·s/rad or N·s/m] per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_target_kd(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_target_kd", values, not_negative, |dof, value| {
            dof.target_kd = value
        })
    }

    /// Sets the largest drive efforts [N·m or N] per dof; infinity is without limit.
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
        self.set("joint_effort_limit", values, check, |dof, value| {
            dof.effort_limit = value.is_finite().then_some(value);
        })
    }

    /// Sets the inertia of the drives [kg·m² or kg] per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_armature(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_armature", values, not_negative, |dof, value| {
            dof.armature = value
        })
    }

    /// Sets the stiffness of the limits [N·m/rad or N/m] per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_limit_ke(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_limit_ke", values, not_negative, |dof, value| {
            dof.limit_ke = Some(value)
        })
    }

    /// Sets the damping of the limits [N·m·s/rad or N·s/m] per dof.
    ///
    /// # Errors
    /// Another number of values than dofs, or a value that is negative or not finite.
    pub fn set_joint_limit_kd(&mut self, values: &[f64]) -> Result<(), ModelError> {
        self.set("joint_limit_kd", values, not_negative, |dof, value| {
            dof.limit_kd = Some(value)
        })
    }

    /// Checks every value, then writes them all in dof order.
    fn set<T: Copy>(
        &mut self,
        field: &'static str,
        values: &[T],
        check: impl Fn(&str, T) -> Result<(), ModelError>,
        write: impl Fn(&mut JointDof, T),
    ) -> Result<(), ModelError> {
        let names = self.dof_names();
        self.check(field, &names, values, check)?;
        let mut values = values.iter();
        for index in self.moving_joints() {
            for (dof, &value) in self.joints[index].dofs.iter_mut().zip(&mut values) {
                write(dof, value);
            }
        }
        Ok(())
    }

    fn check<T: Copy>(
        &self,
        field: &'static str,
        names: &[String],
        values: &[T],
        check: impl Fn(&str, T) -> Result<(), ModelError>,
    ) -> Result<(), ModelError> {
        if values.len() != names.len() {
            let entries = match field {
                "joint_q" => "coordinates",
                _ => "dofs",
            };
            return Err(ModelError::JointValues {
                entries,
                robot: self.name.clone(),
                field,
                expected: names.len(),
                got: values.len(),
            });
        }
        for (name, &value) in names.iter().zip(values) {
            check(
                &format!("robot `{}`: {field} of joint `{name}`", self.name),
                value,
            )?;
        }
        Ok(())
    }
}
