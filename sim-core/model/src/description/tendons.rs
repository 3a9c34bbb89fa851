//! Tendons of a robot that MuJoCo compiled.

use super::output_frames::OnLink;

/// A length that tendons have.
#[derive(Clone, Debug, PartialEq)]
pub enum Length {
    /// The sum of positions of joints with one dof times coefficients.
    Joints(Vec<(usize, f64)>),
    /// That of a spatial tendon, by its place in `Precompiled::spatial_tendons`.
    Spatial(usize),
}

/// A tendon as outputs show it.
#[derive(Clone, Debug, PartialEq)]
pub enum TendonPart {
    /// One that is fixed, or that something uses.
    Used(Length),
    /// A spatial tendon that nothing uses.
    Idle(SpatialTendon),
}

/// A spatial tendon, as [`sim_physics::constants::tendons::SpatialTendon`] has it.
#[derive(Clone, Debug, PartialEq)]
pub struct SpatialTendon {
    /// Its pieces from site to site.
    pub spans: Vec<Span>,
}

/// A piece of a spatial tendon.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// The site where it begins.
    pub from: OnLink,
    /// The site where it ends.
    pub to: OnLink,
    /// How much of it counts [–].
    pub share: f64,
    /// What it bends around.
    pub wrap: Option<Wrap>,
}

/// A shape around which a tendon bends.
#[derive(Clone, Debug, PartialEq)]
pub struct Wrap {
    /// Its frame.
    pub at: OnLink,
    /// Whether it is a cylinder instead of a sphere.
    pub is_cylinder: bool,
    /// [m]
    pub radius: f64,
    /// The site on whose side the tendon stays.
    pub side: Option<OnLink>,
}
