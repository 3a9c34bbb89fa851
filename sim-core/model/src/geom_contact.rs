//! How a MuJoCo geom touches, and how two of them combine.

use crate::softness::Softness;
use crate::surface::Surface;

/// Least weight of a mixture that counts (MuJoCo: `mjMINVAL`).
const WEIGHT_MIN: f64 = 1e-15;

/// Contact parameters of a MuJoCo geom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeomContact {
    /// Bits of what it is.
    pub contype: u32,
    /// Bits of what it touches.
    pub conaffinity: u32,
    /// Dimensions of the contact space: 1, 3, 4 or 6.
    pub condim: usize,
    /// Of two geoms, the one of the higher priority alone decides.
    pub priority: i64,
    /// Weight of its softness in a mixture.
    pub solmix: f64,
    /// Softness.
    pub softness: Softness,
    /// Sliding, torsional and rolling friction [–, m, m].
    pub friction: [f64; 3],
    /// Distance at which a contact acts [m]; those of two geoms are added.
    pub margin: f64,
    /// Extra distance at which a contact is listed [m]; those of two geoms are added.
    pub gap: f64,
    /// How its surface moves beside it, in its frame: velocity at its origin, then angular velocity [m/s, rad/s]; none of a pair.
    pub surface_velocity: [f64; 6],
    /// Force by which a contact pulls [N]; those of two geoms are added.
    pub adhesion: f64,
}

/// Contact parameters that take the place of those of all geoms and pairs of a model (MuJoCo: the flag `override`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactOverride {
    /// Softness, also of friction.
    pub softness: Softness,
    /// Sliding friction along the first tangent, torsional friction, and rolling friction about the first tangent [–, m, m].
    pub friction: [f64; 3],
    /// Sliding friction along the second tangent, and rolling friction about it [–, m].
    pub second: [f64; 2],
    /// Distance at which a contact acts [m]; gaps stay those of geoms and pairs.
    pub margin: f64,
}

impl GeomContact {
    /// The parameters of a contact that a model overrides: only the dimensions and the gap are its own.
    pub(crate) fn overridden(self, by: &ContactOverride) -> GeomContact {
        GeomContact {
            softness: by.softness,
            friction: by.friction,
            margin: by.margin,
            ..self
        }
    }

    /// A surface of ours as a geom, for contacts with one: its stiffness and damping as `solref`, and MuJoCo's defaults.
    pub(crate) fn from_surface(surface: &Surface) -> GeomContact {
        let bits = u32::from(surface.group != 0);
        GeomContact {
            contype: bits,
            conaffinity: bits,
            condim: surface.condim,
            priority: 0,
            solmix: 1.0,
            softness: Softness {
                solref: [2.0 / surface.kd, 0.5 * surface.kd / surface.ke.sqrt()],
                ..Softness::default()
            },
            friction: [surface.mu, 0.005, 0.0001],
            margin: surface.margin,
            gap: surface.gap,
            surface_velocity: [0.0; 6],
            adhesion: 0.0,
        }
    }

    /// Whether two geoms touch, as far as their bits say.
    pub(crate) fn meets(&self, other: &GeomContact) -> bool {
        self.contype & other.conaffinity != 0 || other.contype & self.conaffinity != 0
    }

    /// Its share in a mixture with another one [–].
    pub(crate) fn share(&self, other: &GeomContact) -> f64 {
        match (self.solmix >= WEIGHT_MIN, other.solmix >= WEIGHT_MIN) {
            (true, true) => self.solmix / (self.solmix + other.solmix),
            (false, false) => 0.5,
            (true, false) => 1.0,
            (false, true) => 0.0,
        }
    }

    /// The parameters of a contact of two geoms (MuJoCo: `mj_contactParam`).
    pub(crate) fn combined(&self, other: &GeomContact) -> GeomContact {
        let decides = match self.priority.cmp(&other.priority) {
            std::cmp::Ordering::Greater => Some(self),
            std::cmp::Ordering::Less => Some(other),
            std::cmp::Ordering::Equal => None,
        };
        let (margin, gap) = (self.margin + other.margin, self.gap + other.gap);
        if let Some(geom) = decides {
            return GeomContact {
                margin,
                gap,
                ..*geom
            };
        }
        let share = self.share(other);
        GeomContact {
            condim: self.condim.max(other.condim),
            softness: self.softness.mixed(&other.softness, share),
            friction: std::array::from_fn(|i| self.friction[i].max(other.friction[i])),
            margin,
            gap,
            adhesion: self.adhesion + other.adhesion,
            ..*self
        }
    }
}
