//! Sensors of a robot that MuJoCo compiled.

use super::output_frames::OnLink;
use super::tendons::Length;
use crate::geometry::TriMesh;
pub use sim_physics::constants::sensors::{
    DistancePart, FramePart, LimitPart, Reduction, SubtreePart, ZoneKind,
};

/// The sensors of a robot, in MuJoCo's order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorParts {
    /// All of them.
    pub all: Vec<Sensor>,
    /// What is not supported, a sentence each.
    pub refused: Vec<String>,
    /// Scalars of all.
    pub scalars: usize,
    /// Geoms that rangefinders see.
    pub geoms: Vec<RayPart>,
    /// Triangles of some of them.
    pub meshes: Vec<TriMesh>,
}

/// A sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Its name, unique in the robot.
    pub name: String,
    /// Its scalars in the robot's `sensordata`.
    pub place: std::ops::Range<usize>,
    /// What it measures; none of one that is not supported.
    pub sense: Option<Sense>,
    /// Upper bound of its scalars, and whether its negative is the lower one.
    pub cutoff: Option<(f64, bool)>,
}

/// What a sensor measures, as [`sim_physics::constants::sensors::SensorKind`] has it.
#[derive(Clone, Debug, PartialEq)]
pub enum Sense {
    /// A vector of the world in the axes of a frame.
    Vector(OnLink, [f64; 3]),
    /// A length, or its rate of change.
    Length {
        /// The length.
        of: Length,
        /// Is it the rate of change?
        is_rate: bool,
    },
    /// Length of an actuator, or its rate of change.
    Actuator {
        /// Its index.
        actuator: usize,
        /// Is it the rate of change?
        is_rate: bool,
    },
    /// Quaternion of a ball joint, or its angular velocity.
    Ball {
        /// The joint.
        joint: usize,
        /// Is it the angular velocity?
        is_rate: bool,
    },
    /// A property of a frame, seen from another one if there is one.
    Frame {
        /// Which.
        part: FramePart,
        /// The frame.
        of: OnLink,
        /// The frame that it is seen from.
        from: Option<OnLink>,
        /// Is it given in the axes of the frame itself?
        is_local: bool,
    },
    /// The acceleration of a frame.
    Acceleration {
        /// The frame.
        of: OnLink,
        /// Is it the angular one?
        is_angular: bool,
        /// Is it given in the axes of the frame itself?
        is_local: bool,
    },
    /// A property of a link with all links below it.
    Subtree(usize, SubtreePart),
    /// Force or torque between a link and its parent.
    Wrench {
        /// Where, and in whose axes.
        site: OnLink,
        /// Is it the torque?
        is_torque: bool,
    },
    /// Sum of the forces of actuators.
    ActuatorForces(Vec<usize>),
    /// Force of all actuators on a joint with one dof.
    JointActuatorForce(usize),
    /// A property of the limit of a joint with one dof.
    JointLimit(usize, LimitPart),
    /// A property of a constraint that is the limit of a ball or a tendon; none if it has no limit.
    ConstraintLimit(Option<usize>, LimitPart),
    /// Normal forces of the contacts of a link in a zone.
    Touch(ZonePart),
    /// Records of the contacts between two objects.
    Contact {
        /// Where contacts count, if not everywhere.
        zone: Option<ZonePart>,
        /// The first object.
        first: Touching,
        /// The second object.
        second: Touching,
        /// Which contacts it shows.
        reduction: Reduction,
        /// Most contacts that it shows.
        records: usize,
        /// What it shows of a contact: count, force, torque, distance, position, normal, tangent.
        shows: [bool; 7],
        /// Does it show linear, and angular velocity of the second object as seen from the first?
        rates: [bool; 2],
    },
    /// What a ray from a site along its z axis meets.
    Range {
        /// The site.
        site: OnLink,
        /// Some of [`SensorParts::geoms`].
        geoms: Vec<usize>,
        /// What it shows: distance, direction, origin, point, normal, depth.
        shows: [bool; 6],
    },
    /// How two geoms, or the nearest of several, are apart.
    Distance {
        /// Pairs of [`SensorParts::geoms`].
        pairs: Vec<[usize; 2]>,
        /// Distance from which on none is near [m].
        limit: f64,
        /// What it shows.
        part: DistancePart,
    },
    /// A property of a frame, as a frame sensor's, where a camera follows something or looks at it.
    Aimed {
        /// Which; not the orientation.
        part: FramePart,
        /// The frame.
        of: EyePart,
        /// The frame that it is seen from.
        from: Option<EyePart>,
    },
    /// The pixel of a site in the picture of a camera.
    Projection {
        /// The camera.
        camera: EyePart,
        /// The site.
        site: OnLink,
        /// Focal lengths along x and y [pixels].
        focal: [f64; 2],
        /// Middle of the picture [pixels].
        middle: [f64; 2],
    },
    /// Whether the origin of a frame is in a zone.
    Inside(ZonePart, EyePart),
    /// Potential energy.
    PotentialEnergy,
    /// Kinetic energy.
    KineticEnergy,
    /// Simulated time.
    Clock,
}

impl Sense {
    /// Numbers that it shows.
    pub fn scalars(&self) -> usize {
        const OF_PARTS: [usize; 7] = [1, 3, 3, 1, 3, 3, 3];
        const OF_RAYS: [usize; 6] = [1, 3, 3, 3, 3, 1];
        match self {
            Sense::Vector(..)
            | Sense::Acceleration { .. }
            | Sense::Subtree(..)
            | Sense::Wrench { .. } => 3,
            Sense::Ball { is_rate, .. } => 4 - usize::from(*is_rate),
            Sense::Range { shows, .. } => {
                let shown = OF_RAYS.iter().zip(shows).filter(|(_, shown)| **shown);
                shown.map(|(size, _)| size).sum()
            }
            Sense::Distance { part, .. } => match part {
                DistancePart::Distance => 1,
                DistancePart::Normal => 3,
                DistancePart::Ends => 6,
            },
            Sense::Aimed { .. } => 3,
            Sense::Projection { .. } => 2,
            Sense::Frame { part, .. } => 3 + usize::from(*part == FramePart::Quat),
            Sense::Contact {
                records,
                shows,
                rates,
                ..
            } => {
                let shown = OF_PARTS.iter().zip(shows).filter(|(_, shown)| **shown);
                let of_each: usize = shown.map(|(size, _)| size).sum();
                let velocities = 3 * rates.iter().filter(|shown| **shown).count();
                records.saturating_mul(of_each + velocities)
            }
            Sense::Length { .. }
            | Sense::Actuator { .. }
            | Sense::ActuatorForces(_)
            | Sense::JointActuatorForce(_)
            | Sense::JointLimit(..)
            | Sense::ConstraintLimit(..)
            | Sense::Touch(_)
            | Sense::Inside(..)
            | Sense::PotentialEnergy
            | Sense::KineticEnergy
            | Sense::Clock => 1,
        }
    }
}

/// A solid at a site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZonePart {
    /// The site.
    pub site: OnLink,
    /// Its shape.
    pub kind: ZoneKind,
    /// As MuJoCo's `site_size` [m].
    pub size: [f64; 3],
}

/// A frame that may be that of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyePart {
    /// The frame where nothing aims it.
    pub on: OnLink,
    /// What it follows or looks at.
    pub aim: AimPart,
}

/// What a camera follows or looks at: a link, or the centre of mass of it with all links below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AimPart {
    /// Nothing.
    Fixed,
    /// It keeps a vector from its link [m] and its axes, both in the model's world.
    Follows {
        /// Is it the centre of mass?
        is_center: bool,
        /// The vector [m].
        offset: [f64; 3],
        /// The axes, as rows of the matrix whose columns they are [–].
        axes: [[f64; 3]; 3],
    },
    /// It looks at a link.
    LooksAt {
        /// The link.
        link: usize,
        /// Is it the centre of mass?
        is_center: bool,
    },
}

/// A geom that rangefinders see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayPart {
    /// Its frame.
    pub on: OnLink,
    /// Its shape; none for a plane.
    pub kind: Option<ZoneKind>,
    /// As MuJoCo's `geom_size` [m].
    pub size: [f64; 3],
    /// Its triangles among [`SensorParts::meshes`], if it is made of them.
    pub mesh: Option<usize>,
}

/// What a contact is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touching {
    /// Whatever.
    Anything,
    /// Whatever is in the zone.
    InZone,
    /// A geom.
    Geom(usize),
    /// A link.
    Link(usize),
    /// A link with all links below it.
    Subtree(usize),
}
