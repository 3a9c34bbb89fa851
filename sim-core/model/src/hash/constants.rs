//! Bodies, joints, rows of constraints, and options.

use sim_physics::constants::options::{DryRow, Newton, NoSlip};
use sim_physics::constants::scan::HeightScan;
use sim_physics::constants::site::{Column, Mount, Site};
use sim_physics::constants::{
    Body, Constants, Coupled, Delay, Dof, Equality, Frame, Friction, Impedance, Limit, MassEntry,
    Motion, Part, Soft, Tree,
};
use sim_physics::math::factor::Pattern;

use super::additions::Additions;
use super::text::{Text, View, When, view, words};

view! {
    Delay as "Delay":
        Always { "frames": frames, "substeps": substeps };
    Coupled as "Coupled":
        Always { "pattern": pattern, "places": places };
    Body<f64> as "Body":
        Always {
            "motion": motion,
            "parent": parent,
            "tree": tree,
            "dof": dof,
            "coord": coord,
            "rotation": rotation,
            "exchange": exchange,
            "quat": quat,
            "position": position,
            "mass": mass,
            "center": center,
            "inertia": inertia,
            "parts": parts,
        };
    Part<f64> as "Part":
        Always { "link": link, "mass": mass, "center": center, "inertia": inertia }
        Later { "link_axes": link_axes }
        Later { "link_origin": link_origin };
    Dof<f64> as "Dof":
        Always {
            "body": body,
            "coord": coord,
            "entries": entries,
            "armature": armature,
            "damping": damping,
            "ke": ke,
            "kd": kd,
            "follows_position": follows_position,
            "follows_velocity": follows_velocity,
            "effort_limit": effort_limit,
        }
        Later { "damping_curve": damping_curve };
    MassEntry as "MassEntry":
        Always { "other": other, "place": place };
    Tree<f64> as "Tree":
        Always { "base": base, "free": free };
    Frame<f64> as "Frame":
        Always {
            "body": body,
            "tree": tree,
            "position": position,
            "quat": quat,
            "center": center,
        };
    Soft<f64> as "Soft":
        Always {
            "stiffness": stiffness,
            "damping": damping,
            "inverse_weight": inverse_weight,
            "impedance": impedance,
        };
    Equality<f64> as "Equality":
        Always {
            "follower": follower,
            "leader": leader,
            "multiplier": multiplier,
            "offset": offset,
            "soft": soft,
        };
    Friction<f64> as "Friction":
        Always {
            "dof": dof,
            "loss": loss,
            "damping": damping,
            "weight": weight,
            "regularizer": regularizer,
            "zone": zone,
        };
    Limit<f64> as "Limit":
        Always { "dof": dof, "lower": lower, "upper": upper, "soft": soft }
        => margin;
    Newton<f64> as "Newton":
        Always {
            "iterations": iterations,
            "ls_iterations": ls_iterations,
            "tolerance": tolerance,
            "refinements": refinements,
        }
        Never { "search": search }
        Later { "noslip": noslip };
    NoSlip<f64> as "NoSlip":
        Always {
            "iterations": iterations,
            "tolerance": tolerance,
            "least_gain": least_gain,
            "dry_rows": dry_rows,
        };
    DryRow as "DryRow":
        Always { "row": row, "tie": tie, "place": place };
    HeightScan<f64> as "HeightScan":
        Always {
            "mount": mount,
            "counts": counts,
            "spacing": spacing,
            "reach": reach,
            "first": first,
            "ground": ground,
        };
    Site<f64> as "Site":
        Always {
            "mount": mount,
            "relative_to": relative_to,
            "damping": damping,
            "columns": columns,
        };
    Column as "Column":
        Always { "dof": dof, "is_of_other": is_of_other };
    Mount<f64> as "Mount":
        Always {
            "body": body,
            "tree": tree,
            "position": position,
            "quat": quat,
            "rotation": rotation,
        };
}

impl View for Constants<f64> {
    fn write(&self, text: &mut Text) {
        let Constants {
            dt,
            gravity,
            bodies,
            dofs,
            trees,
            frames,
            damped,
            mass_entries,
            mass_zeros,
            coords,
            equalities,
            frictions,
            limits,
            pattern,
            coupled,
            contacts,
            contact_impedance,
            solver,
            varying,
            delay,
            sites,
            scans,
            ..
        } = self;
        let first: [(&str, &dyn View); 21] = [
            ("dt", dt),
            ("gravity", gravity),
            ("bodies", bodies),
            ("dofs", dofs),
            ("trees", trees),
            ("frames", frames),
            ("damped", damped),
            ("mass_entries", mass_entries),
            ("mass_zeros", mass_zeros),
            ("coords", coords),
            ("equalities", equalities),
            ("frictions", frictions),
            ("limits", limits),
            ("pattern", pattern),
            ("coupled", coupled),
            ("contacts", contacts),
            ("contact_impedance", contact_impedance),
            ("solver", solver),
            ("varying", varying),
            ("delay", delay),
            ("sites", sites),
        ];
        let scans: [(&str, &dyn View); 1] = [("scans", scans)];
        let additions: [(&str, &dyn View); 1] = [("mujoco", &Additions::from_constants(self))];
        text.groups(
            "Constants",
            &[
                (When::Always, &first),
                (When::Later, &scans),
                (When::Later, &additions),
            ],
        );
    }
}

words! {
    Motion: Revolute "Revolute", Prismatic "Prismatic", Ball "Ball", Free "Free", Mocap "Mocap";
}

/// The exponent of impedances before it could be chosen.
const FIRST_POWER: f64 = 2.0;

impl View for Impedance<f64> {
    fn write(&self, text: &mut Text) {
        let Impedance {
            d_min,
            d_max,
            inverse_width,
            midpoint,
            power,
        } = self;
        let first: [(&str, &dyn View); 4] = [
            ("d_min", d_min),
            ("d_max", d_max),
            ("inverse_width", inverse_width),
            ("midpoint", midpoint),
        ];
        let chosen = match *power == FIRST_POWER {
            true => When::Never,
            false => When::Always,
        };
        let power: [(&str, &dyn View); 1] = [("power", power)];
        text.groups("Impedance", &[(When::Always, &first), (chosen, &power)]);
    }
}

impl View for Pattern {
    fn write(&self, text: &mut Text) {
        text.put(&self.layout_text());
    }
}
