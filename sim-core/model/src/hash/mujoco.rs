//! What models from MuJoCo have: springs, actuators, ties, frames.

use sim_physics::constants::actuator::{
    Activation, ActivationRate, LengthKind, Sites, TurningLength,
};
use sim_physics::constants::mujoco::{
    Actuator, ActuatorBound, Compensation, Drag, Integrator, Mujoco, PoseSpring, Search, Spring,
    Tendon, TendonBound, Term,
};
use sim_physics::constants::mujoco_frames::{MujocoBody, MujocoFrames};
use sim_physics::constants::ties::{Frames, Lengths, Measure, Tie, TieLaw};

use super::text::{Text, View, When, view, words};

view! {
    Mujoco<f64> as "Mujoco":
        Always {
            "integrator": integrator,
            "springs": springs,
            "pose_springs": pose_springs,
            "free_joints": free_joints,
            "drags": drags,
            "compensations": compensations,
            "compensated": compensated,
            "compensated_by_actuators": compensated_by_actuators,
            "tendons": tendons,
            "ties": ties,
            "tie_of_row": tie_of_row,
            "equalities": equalities,
            "actuators": actuators,
            "activations": activations,
            "mocaps": mocaps,
            "actuator_bounds": actuator_bounds,
            "tendon_bounds": tendon_bounds,
            "impedances": impedances,
            "pair_impedance": pair_impedance,
            "class_impedances": class_impedances,
            "frames": frames,
            "sensors": sensors,
            "pair_bodies": pair_bodies,
            "class_bodies": class_bodies,
        }
        Never { "search": search };
    Spring<f64> as "Spring":
        Always { "dof": dof, "stiffness": stiffness, "rest": rest };
    PoseSpring<f64> as "PoseSpring":
        Always { "body": body, "stiffness": stiffness, "position": position, "quat": quat };
    Drag<f64> as "Drag":
        Always {
            "body": body,
            "center": center,
            "axes": axes,
            "viscous": viscous,
            "quadratic": quadratic,
            "wind": wind,
        };
    Compensation<f64> as "Compensation":
        Always { "body": body, "link": link, "mass": mass, "share": share, "center": center };
    Tendon<f64> as "Tendon":
        Always { "terms": terms, "stiffness": stiffness, "rest": rest, "damping": damping };
    Actuator<f64> as "Actuator":
        Always {
            "terms": terms,
            "turning": turning,
            "activation": activation,
            "ctrl_range": ctrl_range,
            "force_range": force_range,
            "gain": gain,
            "bias": bias,
        };
    Term<f64> as "Term":
        Always { "dof": dof, "coefficient": coefficient };
    ActuatorBound<f64> as "ActuatorBound":
        Always { "dof": dof, "range": range };
    TendonBound<f64> as "TendonBound":
        Always { "actuators": actuators, "range": range };
    Activation<f64> as "Activation":
        Always {
            "place": place,
            "rate": rate,
            "reach": reach,
            "range": range,
            "early": early,
        };
    TurningLength<f64> as "TurningLength":
        Always { "kind": kind, "gear": gear, "dofs": dofs, "first": first };
    Sites<f64> as "Sites":
        Always { "site": site, "reference": reference };
    Tie<f64> as "Tie":
        Always {
            "measure": measure,
            "law": law,
            "soft": soft,
            "turning_weight": turning_weight,
            "rows": rows,
            "dofs": dofs,
            "first": first,
            "places": places,
        };
    Lengths<f64> as "Lengths":
        Always { "first": first, "second": second, "offsets": offsets, "polynomial": polynomial };
    Frames<f64> as "Frames":
        Always {
            "first": first,
            "second": second,
            "torque_scale": torque_scale,
            "bodies": bodies,
        };
    MujocoFrames<f64> as "MujocoFrames":
        Always { "bodies": bodies, "sites": sites, "geoms": geoms };
    MujocoBody<f64> as "MujocoBody":
        Always {
            "link": link,
            "parent": parent,
            "root": root,
            "frame": frame,
            "inertial": inertial,
            "mass": mass,
            "moments": moments,
        };
}

words! {
    Integrator: ImplicitFast "ImplicitFast", Euler "Euler", RungeKutta "RungeKutta";
}

/// How the solver ends in `f64`: no part of the text, since recordings in `f32` do not depend on it.
impl View for Search<f64> {
    fn write(&self, _: &mut Text) {}
}

impl View for ActivationRate<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            ActivationRate::Held => text.put("Held"),
            ActivationRate::Control => text.put("Control"),
            ActivationRate::Filter(time) => text.tuple("Filter", &[time]),
        }
    }
}

impl View for LengthKind<f64> {
    fn write(&self, text: &mut Text) {
        let (name, key, index, in_parent) = match self {
            LengthKind::Ball { coord, in_parent } => ("Ball", "coord", coord, in_parent),
            LengthKind::Free { body, in_parent } => ("Free", "body", body, in_parent),
            LengthKind::Site(sites) => return text.tuple("Site", &[sites]),
        };
        let values: [(&str, &dyn View); 2] = [(key, index), ("in_parent", in_parent)];
        text.groups(name, &[(When::Always, &values)]);
    }
}

impl View for Measure<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            Measure::Lengths(lengths) => text.tuple("Lengths", &[lengths]),
            Measure::Angle(coord, dof) => text.tuple("Angle", &[coord, dof]),
            Measure::Free(body) => text.tuple("Free", &[body]),
            Measure::Frames(frames) => text.tuple("Frames", &[frames]),
        }
    }
}

impl View for TieLaw<f64> {
    fn write(&self, text: &mut Text) {
        match self {
            TieLaw::Equality(place) => text.tuple("Equality", &[place]),
            TieLaw::Friction(loss) => text.tuple("Friction", &[loss]),
            TieLaw::Range(bounds) => text.tuple("Range", &[bounds]),
        }
    }
}
