//! Sizes of a model, which make the shapes of arrays.

/// Lengths of a model's arrays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Degrees of freedom.
    pub dofs: usize,
    /// Position coordinates.
    pub coords: usize,
    /// Links of all robots, fixed ones included.
    pub bodies: usize,
    /// Constraint rows of joints: equalities, frictions, limits.
    pub rows: usize,
    /// Contacts that a world has room for.
    pub contacts: usize,
    /// Collision shapes.
    pub shapes: usize,
    /// Sites.
    pub sites: usize,
    /// Rays of all height scans.
    pub scan_rays: usize,
    /// Contact sensors.
    pub contact_sensors: usize,
    /// Actuators.
    pub actuators: usize,
    /// Contact pairs that MuJoCo models name.
    pub contact_pairs: usize,
    /// Bodies that clients place.
    pub mocaps: usize,
    /// Equalities of MuJoCo models.
    pub equalities: usize,
    /// Actuators with an activation.
    pub activations: usize,
    /// Bodies of MuJoCo models, the world of each included.
    pub output_bodies: usize,
    /// Sites of MuJoCo models.
    pub output_sites: usize,
    /// Geoms of MuJoCo models.
    pub output_geoms: usize,
    /// Tendons of MuJoCo models.
    pub output_tendons: usize,
    /// Scalars of the sensors of MuJoCo models.
    pub sensordata: usize,
}
