//! Masses and inertias of links as parameters that vary.

use super::carrier::Carrier;
use crate::description::{Description, Robot};
use crate::inertia::Inertial;
use sim_physics::constants::params::{Param, SceneStarts};
use sim_physics::constants::{Constants, Part};

/// Do they vary?
pub(super) fn vary(scene: &Description) -> bool {
    let params = [
        Param::BodyMassScale,
        Param::BodyMass,
        Param::BodyInertia,
        Param::BodyCom,
    ];
    params.iter().any(|param| scene.params.contains(param))
}

/// What the parameters start with; 0 for links without mass.
pub(super) fn starts(scene: &Description) -> SceneStarts {
    let mut starts = SceneStarts::default();
    for robot in &scene.robots {
        for link in robot.link_order() {
            let inertial = robot.links[link].inertial.as_ref();
            starts
                .masses
                .push(inertial.map_or(0.0, |inertial| inertial.mass));
            let tensor = inertial.map_or([[0.0; 3]; 3], |inertial| inertial.inertia);
            starts.inertias.push(packed(tensor));
            let massless = || massless(robot, link).pos;
            starts
                .centers
                .push(inertial.map_or_else(massless, |inertial| inertial.pos));
        }
    }
    starts
}

/// Adds to each body of a robot the links that it carries, in body order. `first` is the number of the robot's first link.
pub(super) fn add_parts(
    m: &mut Constants<f64>,
    scene: &Description,
    robot: &Robot,
    first: usize,
    carriers: &[Carrier],
) {
    let turns = scene.params.contains(&Param::BodyInertia);
    let shifts = scene.params.contains(&Param::BodyCom);
    // a link without mass may be given one
    let is_given = turns || scene.params.contains(&Param::BodyMass);
    for (place, link) in robot.link_order().into_iter().enumerate() {
        let carrier = &carriers[link];
        let inertial = robot.links[link].inertial;
        let inertial = inertial.or_else(|| is_given.then(|| massless(robot, link)));
        let (Some(body), Some(inertial)) = (carrier.body, inertial) else {
            continue;
        };
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        m.bodies[body].parts.push(Part {
            link: first + place,
            mass: inertial.mass,
            center: carrier.pose.transform(inertial.pos),
            inertia: packed(carrier.pose.rotate_tensor(inertial.inertia)),
            link_axes: (turns || shifts).then(|| axes.map(|axis| carrier.pose.rotate(axis))),
            link_origin: shifts.then_some(carrier.pose.pos),
        });
    }
}

/// What a link without mass has, about the centre of mass that its file gives.
pub(super) fn massless(robot: &Robot, link: usize) -> Inertial {
    let parts = robot.precompiled.as_ref();
    Inertial {
        pos: parts.map_or([0.0; 3], |parts| parts.frames.inertias[link].pose.pos),
        ..Inertial::default()
    }
}

/// xx yy zz xy xz yz
fn packed([[xx, xy, xz], [_, yy, yz], [_, _, zz]]: [[f64; 3]; 3]) -> [f64; 6] {
    [xx, yy, zz, xy, xz, yz]
}
