//! What the text has under the key `mujoco`, after all else: springs, actuators, ties, frames of outputs.
//!
//! The first release kept these constants together, for models from MuJoCo alone.

use sim_physics::constants::actuators::{
    Activation, ActivationRate, Actuator, ActuatorBound, Actuators, Adhesion, ControlDelay,
    LengthKind, Motor, Muscle, MuscleRate, Sites, SliderCrank, TendonBound, TurningLength,
};
use sim_physics::constants::contact::{PairImpedances, TouchedBodies};
use sim_physics::constants::lengths::{Length, Term};
use sim_physics::constants::options::{Integrator, Search};
use sim_physics::constants::outputs::{OutputBody, OutputFrames, OutputTendon};
use sim_physics::constants::passive::{Compensation, Drag, FluidGeom, GravityCompensation};
use sim_physics::constants::sensors::Sensors;
use sim_physics::constants::springs::{Plasticity, PoseSpring, Spring, Springs, Tendon};
use sim_physics::constants::tendons::{Inner, Span, SpatialTendon, Wrap};
use sim_physics::constants::ties::{Frames, Lengths, Measure, Tie, TieLaw};

use sim_physics::constants::{Constants, Impedance};
use sim_physics::lane::Fixed;

use super::text::{Text, View, When, view, words};

/// Constants of the second group.
pub(super) struct Additions<'a> {
    integrator: Integrator,
    springs: &'a Vec<Spring<f64>>,
    pose_springs: &'a Vec<PoseSpring<f64>>,
    free_joints: &'a Vec<usize>,
    drags: &'a Vec<Drag<f64>>,
    fluid_geoms: &'a Vec<FluidGeom<f64>>,
    compensations: &'a Vec<Compensation<f64>>,
    passive_dofs: &'a Vec<usize>,
    actuated_dofs: &'a Vec<usize>,
    tendons: &'a Vec<Tendon<f64>>,
    spatial_tendons: &'a Vec<SpatialTendon<f64>>,
    ties: &'a Vec<Tie<f64>>,
    tie_of_row: &'a Vec<usize>,
    switches: usize,
    actuators: &'a Vec<Actuator<f64>>,
    activations: usize,
    mocaps: usize,
    dof_bounds: &'a Vec<ActuatorBound<f64>>,
    tendon_bounds: &'a Vec<TendonBound<f64>>,
    adhesions: &'a Vec<Adhesion>,
    impedances: &'a Vec<Impedance<f64>>,
    pair_impedance: &'a Fixed,
    class_impedances: &'a Vec<Vec<usize>>,
    outputs: &'a OutputFrames<f64>,
    sensors: &'a Sensors<f64>,
    pair_bodies: &'a Fixed,
    class_bodies: &'a Vec<Vec<usize>>,
}

impl Additions<'_> {
    /// Those of a model. A field that is missing here and in the first group is a compile error.
    pub(super) fn from_constants(constants: &Constants<f64>) -> Additions<'_> {
        let Constants {
            dt: _,
            gravity: _,
            bodies: _,
            dofs: _,
            trees: _,
            frames: _,
            damped: _,
            mass_entries: _,
            mass_zeros: _,
            coords: _,
            equalities: _,
            frictions: _,
            limits: _,
            pattern: _,
            coupled: _,
            contacts,
            contact_impedance: _,
            solver: _,
            varying: _,
            delay: _,
            sites: _,
            scans: _,
            integrator,
            tendons: spatial_tendons,
            springs:
                Springs {
                    joints,
                    poses,
                    tendons,
                },
            free_joints,
            diagonal_dofs: _,
            solved_bodies: _,
            gyroscopic_bodies: _,
            drags,
            fluid_geoms,
            compensation:
                GravityCompensation {
                    links,
                    passive_dofs,
                    actuated_dofs,
                },
            ties,
            tie_of_row,
            switches,
            actuators:
                Actuators {
                    all,
                    activations,
                    damped: _,
                    dof_bounds,
                    tendon_bounds,
                    adhesions,
                },
            mocaps,
            outputs,
            sensors,
        } = constants;
        let PairImpedances {
            all: impedances,
            of_pair: pair_impedance,
            of_classes: class_impedances,
        } = &contacts.impedances;
        let TouchedBodies {
            of_pair: pair_bodies,
            of_classes: class_bodies,
        } = &contacts.bodies;
        Additions {
            integrator: *integrator,
            springs: joints,
            pose_springs: poses,
            free_joints,
            drags,
            fluid_geoms,
            compensations: links,
            passive_dofs,
            actuated_dofs,
            tendons,
            spatial_tendons,
            ties,
            tie_of_row,
            switches: *switches,
            actuators: all,
            activations: *activations,
            mocaps: *mocaps,
            dof_bounds,
            tendon_bounds,
            adhesions,
            impedances,
            pair_impedance,
            class_impedances,
            outputs,
            sensors,
            pair_bodies,
            class_bodies,
        }
    }
}

view! {
    Additions<'_> as "Mujoco":
        Always {
            "integrator": integrator,
            "springs": springs,
            "pose_springs": pose_springs,
            "free_joints": free_joints,
            "drags": drags,
            "compensations": compensations,
            "compensated": passive_dofs,
            "compensated_by_actuators": actuated_dofs,
            "tendons": tendons,
            "ties": ties,
            "tie_of_row": tie_of_row,
            "equalities": switches,
            "actuators": actuators,
            "activations": activations,
            "mocaps": mocaps,
            "actuator_bounds": dof_bounds,
            "tendon_bounds": tendon_bounds,
            "impedances": impedances,
            "pair_impedance": pair_impedance,
            "class_impedances": class_impedances,
            "frames": outputs,
            "sensors": sensors,
            "pair_bodies": pair_bodies,
            "class_bodies": class_bodies,
        }
        Later { "spatial_tendons": spatial_tendons }
        Later { "adhesions": adhesions }
        Later { "fluid_geoms": fluid_geoms };
    Spring<f64> as "Spring":
        Always { "dof": dof, "stiffness": stiffness, "rest": rest }
        Later { "curve": curve }
        Later { "plasticity": plasticity };
    PoseSpring<f64> as "PoseSpring":
        Always { "body": body, "stiffness": stiffness, "position": position, "quat": quat }
        Later { "curve": curve }
        Later { "plasticity": plasticity };
    Plasticity<f64> as "Plasticity":
        Always { "place": place, "bound": bound };
    Drag<f64> as "Drag":
        Always {
            "body": body,
            "center": center,
            "axes": axes,
            "viscous": viscous,
            "quadratic": quadratic,
            "wind": wind,
        };
    FluidGeom<f64> as "FluidGeom":
        Always {
            "body": body,
            "center": center,
            "axes": axes,
            "areas": areas,
            "area_differences": area_differences,
            "carried": carried,
            "mass_differences": mass_differences,
            "moment_differences": moment_differences,
            "lift": lift,
            "viscous": viscous,
            "slender": slender,
            "blunt": blunt,
            "turning": turning,
            "turning_shares": turning_shares,
            "wind": wind,
        };
    Compensation<f64> as "Compensation":
        Always { "body": body, "link": link, "mass": mass, "share": share, "center": center };
    Tendon<f64> as "Tendon":
        Always { "terms": length, "stiffness": stiffness, "rest": rest, "damping": damping }
        Later { "armature": armature }
        Later { "stiffness_curve": stiffness_curve }
        Later { "damping_curve": damping_curve }
        Later { "plasticity": plasticity };
    Actuator<f64> as "Actuator":
        Always {
            "terms": terms,
            "turning": turning,
            "activation": activation,
            "ctrl_range": ctrl_range,
            "force_range": force_range,
            "gain": gain,
            "bias": bias,
        }
        Later { "muscle_gain": muscle_gain, "muscle_bias": muscle_bias }
        Later { "motor": motor }
        Later { "delay": delay };
    ControlDelay<f64> as "ControlDelay":
        Always { "place": place, "first": first, "steps": steps, "weights": weights };
    Motor<f64> as "Motor":
        Always {
            "constant": constant,
            "per_volt": per_volt,
            "voltage": voltage,
            "current_rate": current_rate,
            "cogging": cogging,
        };
    Muscle<f64> as "Muscle":
        Always {
            "peak": peak,
            "shortest": shortest,
            "l_shortest": l_shortest,
            "inverse_optimum": inverse_optimum,
            "inverse_speed": inverse_speed,
            "l_min": l_min,
            "l_max": l_max,
            "fp_max": fp_max,
            "fv_max": fv_max,
        };
    MuscleRate<f64> as "MuscleRate":
        Always { "rise": rise, "fall": fall, "width": width };
    SpatialTendon<f64> as "SpatialTendon":
        Always { "spans": spans, "dofs": dofs }
        => bodies, moved, first, free_bodies;
    Span<f64> as "Span":
        Always { "from": from, "to": to, "share": share, "wrap": wrap };
    Wrap<f64> as "Wrap":
        Always {
            "at": at,
            "is_cylinder": is_cylinder,
            "radius": radius,
            "side": side,
            "inner": inner,
        };
    Term<f64> as "Term":
        Always { "dof": dof, "coefficient": coefficient };
    ActuatorBound<f64> as "ActuatorBound":
        Always { "dof": dof, "range": range };
    TendonBound<f64> as "TendonBound":
        Always { "actuators": actuators, "range": range };
    Adhesion as "Adhesion":
        Always { "actuator": actuator, "body": body };
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
    SliderCrank<f64> as "SliderCrank":
        Always { "slider": slider, "crank": crank, "rod": rod };
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
        Always { "first": first, "second": second, "offsets": offsets, "polynomial": polynomial }
        => referred;
    Frames<f64> as "Frames":
        Always {
            "first": first,
            "second": second,
            "torque_scale": torque_scale,
            "bodies": bodies,
        };
    OutputFrames<f64> as "MujocoFrames":
        Always { "bodies": bodies, "sites": sites, "geoms": geoms }
        Never { "tendons": tendons };
    OutputTendon<f64> as "OutputTendon":
        Always { "length": length, "idle": idle };
    OutputBody<f64> as "MujocoBody":
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
    Inner: Never "Never", Always "Always", Sometimes "Sometimes";
    Integrator: ImplicitFast "ImplicitFast", Euler "Euler", RungeKutta "RungeKutta",
        Implicit "Implicit";
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
            ActivationRate::Muscle(rate) => text.tuple("Muscle", &[rate]),
            ActivationRate::Current(time) => text.tuple("Current", &[time]),
        }
    }
}

/// A length of joints alone is their list.
impl View for Length<f64> {
    fn write(&self, text: &mut Text) {
        match &self.tendon {
            Some(tendon) => text.tuple("Spatial", &[&self.terms, tendon]),
            None => self.terms.write(text),
        }
    }
}

impl View for LengthKind<f64> {
    fn write(&self, text: &mut Text) {
        let (name, key, index, in_parent) = match self {
            LengthKind::Ball { coord, in_parent } => ("Ball", "coord", coord, in_parent),
            LengthKind::Free { body, in_parent } => ("Free", "body", body, in_parent),
            LengthKind::Site(sites) => return text.tuple("Site", &[sites]),
            LengthKind::Tendon(tendon) => return text.tuple("Tendon", &[tendon]),
            LengthKind::SliderCrank(crank) => return text.tuple("SliderCrank", &[crank]),
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
