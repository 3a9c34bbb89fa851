//! Inertias that no body can have, replaced as MuJoCo does.

use super::robot::Robot;
use crate::inertia::{negative_moment, triangle_excess};

impl Robot {
    /// Replaces each inertia whose principal moments break A + B >= C by a sphere's of the same trace, as MuJoCo's
    /// `balanceinertia` does, notes link and ratio, and warns of all of them together.
    pub fn balance_inertias(&mut self) {
        let mut balanced = Vec::new();
        for link in &mut self.links {
            let Some(inertial) = &mut link.inertial else {
                continue;
            };
            if negative_moment(inertial.inertia).is_some() {
                continue; // an error, which validate() reports
            }
            if let Some(ratio) = triangle_excess(inertial.inertia) {
                let mean = (0..3).map(|i| inertial.inertia[i][i]).sum::<f64>() / 3.0;
                inertial.inertia = [[mean, 0.0, 0.0], [0.0, mean, 0.0], [0.0, 0.0, mean]];
                self.notes.push(format!(
                    "link `{}`: its largest principal moment of inertia was {ratio:.4} times the sum of the other two, which no body \
                     can have; all three are now their mean, {mean:e} kg·m²",
                    link.name
                ));
                balanced.push(format!("`{}` ({ratio:.4})", link.name));
            }
        }
        if !balanced.is_empty() {
            self.warnings.push(format!(
                "principal moments of inertia break A + B >= C and were balanced, as MuJoCo does, at the links (largest over the \
                 sum of the others): {}; mend <inertia> there, or refuse such files by strict=True",
                balanced.join(", ")
            ));
        }
    }
}
