//! Frames and tendons of a robot that MuJoCo compiled, in MuJoCo's order: what outputs show of it and physics does not need.

use super::tendons::TendonPart;
use crate::pose::Pose;

/// Frames of links, sites and geoms, and tendons.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameParts {
    /// Inertia of each link, as MuJoCo has it.
    pub inertias: Vec<Inertia>,
    /// Sites.
    pub sites: Vec<OnLink>,
    /// Geoms, also those that touch nothing.
    pub geoms: Vec<OnLink>,
    /// Of each geom, its place among the shapes of its link, if it may touch something.
    pub collisions: Vec<Option<usize>>,
    /// Names of the sites.
    pub site_names: Vec<String>,
    /// Names of the geoms.
    pub geom_names: Vec<String>,
    /// Tendons.
    pub tendons: Vec<TendonPart>,
    /// Names of the tendons.
    pub tendon_names: Vec<String>,
}

/// A frame on a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnLink {
    /// The link.
    pub link: usize,
    /// The frame in the link's.
    pub pose: Pose,
    /// Whether it is at the link's centre of mass, along its axes of inertia.
    pub is_inertial: bool,
}

/// Inertia of a link about its principal axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// [kg]
    pub mass: f64,
    /// Centre of mass and principal axes in the link's frame.
    pub pose: Pose,
    /// Principal moments [kg·m²].
    pub moments: [f64; 3],
}
