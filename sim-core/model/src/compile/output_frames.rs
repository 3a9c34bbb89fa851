//! Frames of MuJoCo models on the bodies that carry them, and their tendons.

use super::carrier::Carrier;
use super::sites::mounted;
use super::tendons::{Lengths, idle};
use crate::description::{OnLink, Precompiled, TendonPart};
use sim_physics::constants::Body;
use sim_physics::constants::outputs::{OutputBody, OutputFrames, OutputTendon};
use sim_physics::constants::site::Mount;

/// Adds the frames of a model. `carriers` has an entry for each of its links, `first_link` is the number of the first.
pub(super) fn add_frames(
    frames: &mut OutputFrames<f64>,
    parts: &Precompiled,
    carriers: &[Carrier],
    first_link: usize,
) {
    let first = frames.bodies.len();
    let mount = |on: &OnLink| mounted_on(carriers, on);
    for (link, inertia) in parts.frames.inertias.iter().enumerate() {
        let mounted = |pose| {
            mounted_on(
                carriers,
                &OnLink {
                    link,
                    pose,
                    is_inertial: false,
                },
            )
        };
        frames.bodies.push(OutputBody {
            link: first_link + link,
            parent: first + parts.parents[link],
            root: first + root(&parts.parents, link),
            frame: mounted(crate::Pose::identity()),
            inertial: mounted(inertia.pose),
            mass: inertia.mass,
            moments: inertia.moments,
        });
    }
    frames.sites.extend(parts.frames.sites.iter().map(mount));
    frames.geoms.extend(parts.frames.geoms.iter().map(mount));
}

/// Adds the tendons of a model, which `lengths` has the used ones of.
pub(super) fn add_tendon_lengths(
    frames: &mut OutputFrames<f64>,
    parts: &Precompiled,
    lengths: &Lengths<'_>,
    carriers: &[Carrier],
    bodies: &[Body<f64>],
) {
    let tendons = parts.frames.tendons.iter().map(|tendon| match tendon {
        TendonPart::Used(length) => OutputTendon {
            length: lengths.length(length),
            idle: None,
        },
        TendonPart::Idle(tendon) => OutputTendon {
            length: Vec::new().into(),
            idle: Some(idle(tendon, carriers, bodies)),
        },
    });
    frames.tendons.extend(tendons);
}

/// A frame on a link as the kernel source reads it.
pub(super) fn mounted_on(carriers: &[Carrier], on: &OnLink) -> Mount<f64> {
    let carrier = &carriers[on.link];
    mounted(
        carrier.body,
        Some(carrier.tree),
        &carrier.pose.mul(&on.pose),
    )
}

/// The ancestor of a link that is a child of the world, link 0, or the link itself.
fn root(parents: &[usize], link: usize) -> usize {
    let mut link = link;
    while parents[link] != 0 {
        link = parents[link];
    }
    link
}
