//! Starts, and what a reset draws.

use sim_physics::constants::params::{Param, Varying};

use super::text::{Text, View, When, view};
use crate::description::ParamDraw;
use crate::distribution::Distribution;
use crate::model::{SensedShapes, Start};

view! {
    Start as "Start":
        Always {
            "joint_q": joint_q,
            "joint_target_q": joint_target_q,
            "joint_target_qd": joint_target_qd,
        }
        Later { "mocap_pos": mocap_pos, "mocap_quat": mocap_quat, "eq_active": eq_active }
        Always {
            "joint_q_offset": joint_q_offset,
            "joint_qd_offset": joint_qd_offset,
            "params": params,
        };
    ParamDraw as "ParamDraw":
        Always { "param": param, "column": column, "distribution": distribution };
    SensedShapes as "SensedShapes":
        Always { "name": name, "of": of, "against": against };
}

impl View for Distribution {
    fn write(&self, text: &mut Text) {
        let (name, keys, numbers) = match self {
            Distribution::Uniform { low, high } => ("Uniform", ["low", "high"], [low, high]),
            Distribution::Normal { mean, std } => ("Normal", ["mean", "std"], [mean, std]),
        };
        let values = [(keys[0], numbers[0] as &dyn View), (keys[1], numbers[1])];
        text.groups(name, &[(When::Always, &values)]);
    }
}

impl View for Param {
    /// Its public name, each word with a capital.
    fn write(&self, text: &mut Text) {
        for word in self.row().name.split('_') {
            let (first, rest) = word.split_at(1);
            text.put(&first.to_uppercase());
            text.put(rest);
        }
    }
}

/// How many parameters there were when places of parameters joined the text, and whenever more joined them.
const GENERATIONS: [usize; 4] = [22, 26, 31, 39];

impl View for Varying {
    /// The places have an entry for each parameter up to the end of the generation of the last that varies: a parameter that joins
    /// the table changes the hash of no model where it does not vary.
    fn write(&self, text: &mut Text) {
        let mut places: Vec<Option<usize>> = Param::ALL.map(|param| self.first(param)).to_vec();
        let used = places
            .iter()
            .rposition(Option::is_some)
            .map_or(0, |last| last + 1);
        let length = GENERATIONS.into_iter().find(|&length| length >= used);
        places.truncate(length.unwrap_or(used));
        let starts = self.starts().to_vec();
        let values: [(&str, &dyn View); 2] = [("first", &places), ("starts", &starts)];
        text.groups("Varying", &[(When::Always, &values)]);
    }
}
