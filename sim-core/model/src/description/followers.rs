//! Followers of a robot: mimic joints start, and are commanded, where their leaders put them.

use super::{Joint, JointDof, Mimic, Robot};

impl Mimic {
    /// The follower's position where its leader is here [rad or m].
    pub fn position(&self, leader: f64) -> f64 {
        self.offset + self.multiplier * leader
    }

    /// The follower's velocity at this one of its leader [rad/s or m/s].
    pub fn velocity(&self, leader: f64) -> f64 {
        self.multiplier * leader
    }
}

impl Robot {
    /// Starts every follower where its leader puts it.
    pub fn start_followers(&mut self) {
        start_followers(&mut self.joints);
    }

    /// Gives every follower the position target that belongs to its leader's, if that has one.
    pub fn aim_followers(&mut self) {
        self.of_leaders(|dof, mimic, leader| {
            dof.target_q = leader.target_q.map(|target| mimic.position(target));
        });
    }

    /// Gives every follower the velocity target that belongs to its leader's.
    pub fn pace_followers(&mut self) {
        self.of_leaders(|dof, mimic, leader| dof.target_qd = mimic.velocity(leader.target_qd));
    }

    fn of_leaders(&mut self, set: impl Fn(&mut JointDof, Mimic, &JointDof)) {
        for index in 0..self.joints.len() {
            if let Some(mimic) = self.joints[index].mimic {
                let leader = self.joints[mimic.joint].dofs[0].clone();
                set(&mut self.joints[index].dofs[0], mimic, &leader);
            }
        }
    }
}

/// Starts every follower where its leader puts it.
pub(crate) fn start_followers(joints: &mut [Joint]) {
    for index in 0..joints.len() {
        if let Some(mimic) = joints[index].mimic {
            joints[index].q[0] = mimic.position(joints[mimic.joint].q[0]);
        }
    }
}
