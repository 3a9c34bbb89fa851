//! Sensors of MuJoCo models.

use super::lengths::Length;
use super::recast::{Recast, recast, same};
use super::site::Mount;
use crate::lane::{Fixed, Real};

/// Scalars of a record of a contact: force, torque, distance, position, normal, tangent.
pub const RECORD: usize = 16;
/// A record and what it is sorted by.
pub const SLOT: usize = RECORD + 1;
/// The same with linear and angular velocity.
pub const LONG_SLOT: usize = SLOT + 6;

recast! {
    /// Sensors of MuJoCo models in MuJoCo's order, model after model; none for other models.
    #[derive(Clone, Debug)]
    pub struct Sensors<R> {
        /// Those that the physics evaluates.
        pub all: Vec<Sensor<R>>,
        /// Scalars of all sensors.
        pub scalars: usize,
        /// Most records of a sensor of contacts.
        pub records: usize,
        /// Of each pair of shapes: 1 where MuJoCo's normal is ours, else -1; then of each sensor of contacts 1 where our normal
        /// points from its first object to its second, -1 where it is the other way, 0 where the pair is not of the sensor.
        pub pairs: Fixed,
        /// Of each pair of shapes, its place in MuJoCo's order of contacts, where a sensor takes the first of them or the solver
        /// sweeps them.
        pub ranks: Fixed,
        /// What rangefinders see.
        pub geoms: Vec<RayGeom<R>>,
        /// Triangles of these geoms.
        pub triangles: RayTables,
    }
}

recast! {
    /// A geom that rangefinders see.
    #[derive(Clone, Debug)]
    pub struct RayGeom<R> {
        /// Its frame.
        pub at: Mount<R>,
        /// Its shape; none for a plane.
        pub kind: Option<ZoneKind>,
        /// As MuJoCo's `geom_size` [m].
        pub size: [R; 3],
        /// The first and the end of its boxes of triangles, if it is made of them.
        pub boxes: Option<(usize, usize)>,
    }
}

/// Where the triangles that rays meet are in the tables of a model, in boxes of such that are near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayTables {
    /// Centre and half extents of each box, in the axes of its geom. `(boxes, 6)` [m]
    pub boxes: Fixed,
    /// First triangle of each box, and the end. Indices. `(boxes, 2)`
    pub spans: Fixed,
    /// Corners of each triangle, counter-clockwise from outside. `(triangles, 9)` [m]
    pub triangles: Fixed,
}

impl<R> Default for Sensors<R> {
    fn default() -> Sensors<R> {
        Sensors {
            all: Vec::new(),
            scalars: 0,
            records: 0,
            pairs: Fixed::default(),
            ranks: Fixed::default(),
            geoms: Vec::new(),
            triangles: RayTables::default(),
        }
    }
}

recast! {
    /// A sensor.
    #[derive(Clone, Debug)]
    pub struct Sensor<R> {
        /// What it measures.
        pub kind: SensorKind<R>,
        /// Its first scalar.
        pub first: usize,
        /// Bounds of its scalars, if it has any.
        pub cutoff: Option<Cutoff<R>>,
    }
}

recast! {
    /// Bounds of the scalars of a sensor (MuJoCo: `cutoff`).
    #[derive(Clone, Debug)]
    pub struct Cutoff<R> {
        /// Upper bound.
        pub most: R,
        /// Is its negative the lower bound?
        pub is_two_sided: bool,
    }
}

impl<R> Sensors<R> {
    /// Scalars of the records of a sensor of contacts, as it keeps them.
    pub fn record_scalars(&self) -> usize {
        let has_rates = |kind: &SensorKind<R>| match kind {
            SensorKind::Contact(contact) => contact.rates.is_some(),
            _ => false,
        };
        let is_long = self.all.iter().any(|sensor| has_rates(&sensor.kind));
        self.records * if is_long { LONG_SLOT } else { SLOT }
    }
}

/// What a sensor measures.
#[derive(Clone, Debug)]
pub enum SensorKind<R> {
    /// A vector of the world in the axes of a frame (MuJoCo: `magnetometer`).
    Vector(Mount<R>, [R; 3]),
    /// A length [rad or m].
    Length(Length<R>),
    /// Its rate of change [rad/s or m/s].
    Rate(Length<R>),
    /// Length of an actuator [rad or m].
    ActuatorLength(usize),
    /// Its rate of change [rad/s or m/s].
    ActuatorRate(usize),
    /// The quaternion at a coordinate.
    BallQuat(usize),
    /// The angular velocity at a dof [rad/s].
    BallRate(usize),
    /// A property of a frame.
    Frame(FrameSensor<R>),
    /// The acceleration of a frame, gravity included.
    Acceleration(AccelerationSensor<R>),
    /// A property of a body with all bodies below it.
    Subtree(usize, SubtreePart),
    /// Force or torque between a body and its parent.
    Wrench(WrenchSensor<R>),
    /// Sum of the forces of actuators [N or N·m].
    ActuatorForces(Vec<usize>),
    /// Force of all actuators on a dof [N or N·m].
    DofActuatorForce(usize),
    /// A property of the limit of a dof.
    DofLimit(usize, LimitPart),
    /// A property of the ties that are the limit of a ball or a tendon.
    TieLimit(Vec<usize>, LimitPart),
    /// Normal forces of the contacts of a body in a zone [N].
    Touch(TouchSensor<R>),
    /// Records of contacts.
    Contact(ContactSensor<R>),
    /// What a ray from a site along its z axis meets.
    Range(RangeSensor<R>),
    /// How two geoms, or the nearest of several, are apart.
    Distance(DistanceSensor<R>),
    /// A property of a frame, as a frame sensor's, where a camera follows something or looks at it.
    Aimed(AimedSensor<R>),
    /// The pixel of a site in the picture of a camera (MuJoCo: `camprojection`).
    Projection(ProjectionSensor<R>),
    /// 1 where the origin of a frame is in a zone, else 0 (MuJoCo: `insidesite`).
    Inside(Zone<R>, Eye<R>),
    /// Potential energy [J]; the first moment of what stands still [kg·m].
    PotentialEnergy([R; 3]),
    /// Kinetic energy [J].
    KineticEnergy,
    /// Simulated time [s], which backends write.
    Clock,
}

recast! {
    /// A property of a frame, as seen from another one if there is one.
    #[derive(Clone, Debug)]
    pub struct FrameSensor<R> {
        /// Which property.
        pub part: FramePart,
        /// The frame.
        pub of: Mount<R>,
        /// The frame that it is seen from, and in whose axes it is given; none for the world.
        pub from: Option<Mount<R>>,
        /// Is it given in the axes of the frame itself?
        pub is_local: bool,
    }
}

recast! {
    /// A frame that may be that of a camera.
    #[derive(Clone, Debug)]
    pub struct Eye<R> {
        /// The frame where nothing aims it. It moves with that body in any case, as in MuJoCo.
        pub mount: Mount<R>,
        /// What it follows or looks at.
        pub aim: Aim<R>,
    }
}

/// What a camera follows or looks at.
#[derive(Clone, Debug)]
pub enum Aim<R> {
    /// Nothing.
    Fixed,
    /// It keeps a vector from a place [m], and its axes by columns [–], both in the world.
    Follows(Place<R>, [R; 3], [[R; 3]; 3]),
    /// It looks at a place, its x axis level.
    LooksAt(Place<R>),
}

/// A place that a camera follows or looks at.
#[derive(Clone, Debug)]
pub enum Place<R> {
    /// The origin of a frame.
    Origin(Mount<R>),
    /// The centre of mass of a body of MuJoCo models with all bodies below it.
    Center(usize),
}

recast! {
    /// A property of a frame, as a frame sensor's, where a camera follows something or looks at it.
    #[derive(Clone, Debug)]
    pub struct AimedSensor<R> {
        /// Which property. Orientations are those of the mounts, so no sensor of them is here.
        pub part: FramePart,
        /// The frame.
        pub of: Eye<R>,
        /// The frame that it is seen from, and in whose axes it is given; none for the world.
        pub from: Option<Eye<R>>,
    }
}

recast! {
    /// The pixel of a site in the picture of a camera.
    #[derive(Clone, Debug)]
    pub struct ProjectionSensor<R> {
        /// The camera, which looks along -z.
        pub camera: Eye<R>,
        /// The site.
        pub site: Mount<R>,
        /// Focal lengths along x and y [pixels].
        pub focal: [R; 2],
        /// Middle of the picture [pixels].
        pub middle: [R; 2],
    }
}

recast! {
    /// The acceleration of a frame, gravity included.
    #[derive(Clone, Debug)]
    pub struct AccelerationSensor<R> {
        /// The frame.
        pub of: Mount<R>,
        /// Is it the angular one [rad/s²], or that of the origin [m/s²]?
        pub is_angular: bool,
        /// Is it given in the axes of the frame itself, or in those of the world?
        pub is_local: bool,
    }
}

recast! {
    /// Force or torque between a body and its parent, at a site and in its axes.
    #[derive(Clone, Debug)]
    pub struct WrenchSensor<R> {
        /// The site.
        pub site: Mount<R>,
        /// The body, among those of MuJoCo models.
        pub body: usize,
        /// Is it the torque [N·m], or the force [N]?
        pub is_torque: bool,
    }
}

recast! {
    /// Normal forces of the contacts of a body whose rays outwards meet a zone.
    #[derive(Clone, Debug)]
    pub struct TouchSensor<R> {
        /// The zone.
        pub zone: Zone<R>,
        /// Its column of the table of pairs.
        pub column: usize,
        /// Classes of contacts that have any of its pairs.
        pub classes: Vec<usize>,
    }
}

recast! {
    /// Records of the contacts between two objects.
    #[derive(Clone, Debug)]
    pub struct ContactSensor<R> {
        /// Where contacts count, if not everywhere.
        pub zone: Option<Zone<R>>,
        /// Its column of the table of pairs.
        pub column: usize,
        /// Classes of contacts that have any of its pairs.
        pub classes: Vec<usize>,
        /// Which contacts it shows.
        pub reduction: Reduction,
        /// Most contacts that it shows.
        pub records: usize,
        /// What it shows of a contact: count, force, torque, distance, position, normal, tangent.
        pub shows: [bool; 7],
        /// Its pairs of a plane and a capsule, each with the capsule among the solids: their first tangent is along it.
        pub capsules: Vec<(usize, usize)>,
        /// How fast its second object moves from the first, if it shows that.
        pub rates: Option<ContactRates>,
    }
}

/// Velocities that a sensor of contacts shows (MuJoCo: `linvel`, `angvel`).
#[derive(Clone, Debug)]
pub struct ContactRates {
    /// Which: linear [m/s], angular [rad/s].
    pub shows: [bool; 2],
    /// Columns of the table of pairs with the moving bodies of both shapes, from 1; 0 for none.
    pub column: usize,
    /// Moving bodies that its contacts are of.
    pub bodies: Vec<usize>,
}

recast! {
    /// What a ray from a site along its z axis meets.
    #[derive(Clone, Debug)]
    pub struct RangeSensor<R> {
        /// The site.
        pub site: Mount<R>,
        /// The geoms that it sees.
        pub geoms: Vec<usize>,
        /// What it shows: distance, direction, origin, point, normal, depth.
        pub shows: [bool; 6],
    }
}

recast! {
    /// How two geoms are apart.
    #[derive(Clone, Debug)]
    pub struct DistanceSensor<R> {
        /// Pairs of planes, spheres and capsules, as rays see them. The nearest one counts.
        pub pairs: Vec<[usize; 2]>,
        /// Distance from which on none is near [m].
        pub limit: R,
        /// What it shows.
        pub part: DistancePart,
    }
}

/// What a sensor shows of two geoms that are apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DistancePart {
    /// Their distance, negative where they overlap [m].
    Distance,
    /// The direction of the segment between them [–].
    Normal,
    /// Its ends on the first and on the second geom [m].
    Ends,
}

recast! {
    /// A solid at a site.
    #[derive(Clone, Debug)]
    pub struct Zone<R> {
        /// The site.
        pub site: Mount<R>,
        /// Its shape.
        pub kind: ZoneKind,
        /// As MuJoCo's `site_size` [m].
        pub size: [R; 3],
    }
}

/// Shapes of zones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ZoneKind {
    /// Around the origin.
    Sphere,
    /// Along z.
    Capsule,
    /// Along the axes.
    Ellipsoid,
    /// Along z.
    Cylinder,
    /// Along the axes.
    Box,
}

/// Which contacts a sensor shows (MuJoCo: `reduce`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduction {
    /// The first that are found.
    First,
    /// The deepest.
    LeastDistance,
    /// Those with the largest forces.
    LargestForce,
    /// The sum of all.
    NetForce,
}

/// A property of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FramePart {
    /// Origin [m].
    Position,
    /// Orientation, (w, x, y, z).
    Quat,
    /// One of its axes.
    Axis(usize),
    /// Velocity of the origin [m/s].
    Velocity,
    /// Angular velocity [rad/s].
    Spin,
}

/// A property of a body with all bodies below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SubtreePart {
    /// Centre of mass [m].
    Center,
    /// Its velocity [m/s].
    Velocity,
    /// Angular momentum about it [kg·m²/s].
    AngularMomentum,
}

/// A property of a limit; 0 where it does not act.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitPart {
    /// Distance to where it acts [rad or m].
    Position,
    /// Its rate of change [rad/s or m/s].
    Velocity,
    /// Force [N·m or N].
    Force,
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for SensorKind<R> {
    type Out = SensorKind<S>;
    fn recast(&self) -> SensorKind<S> {
        use SensorKind::*;
        match self {
            Vector(mount, vector) => Vector(mount.recast(), vector.recast()),
            Length(length) => Length(length.recast()),
            Rate(length) => Rate(length.recast()),
            ActuatorLength(actuator) => ActuatorLength(*actuator),
            ActuatorRate(actuator) => ActuatorRate(*actuator),
            BallQuat(coord) => BallQuat(*coord),
            BallRate(dof) => BallRate(*dof),
            Frame(frame) => Frame(frame.recast()),
            Acceleration(frame) => Acceleration(frame.recast()),
            Subtree(body, part) => Subtree(*body, *part),
            Wrench(wrench) => Wrench(wrench.recast()),
            ActuatorForces(actuators) => ActuatorForces(actuators.clone()),
            DofActuatorForce(dof) => DofActuatorForce(*dof),
            DofLimit(dof, part) => DofLimit(*dof, *part),
            TieLimit(ties, part) => TieLimit(ties.clone(), *part),
            Touch(touch) => Touch(touch.recast()),
            Contact(contact) => Contact(contact.recast()),
            Range(range) => Range(range.recast()),
            Distance(distance) => Distance(distance.recast()),
            Aimed(frame) => Aimed(frame.recast()),
            Projection(projection) => Projection(projection.recast()),
            Inside(zone, eye) => Inside(zone.recast(), eye.recast()),
            PotentialEnergy(moment) => PotentialEnergy(moment.recast()),
            KineticEnergy => KineticEnergy,
            Clock => Clock,
        }
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for Aim<R> {
    type Out = Aim<S>;
    fn recast(&self) -> Aim<S> {
        match self {
            Aim::Fixed => Aim::Fixed,
            Aim::Follows(place, offset, axes) => {
                Aim::Follows(place.recast(), offset.recast(), axes.recast())
            }
            Aim::LooksAt(place) => Aim::LooksAt(place.recast()),
        }
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for Place<R> {
    type Out = Place<S>;
    fn recast(&self) -> Place<S> {
        match self {
            Place::Origin(mount) => Place::Origin(mount.recast()),
            Place::Center(body) => Place::Center(*body),
        }
    }
}

same! { ContactRates, DistancePart, RayTables, FramePart, SubtreePart, LimitPart }
same! { ZoneKind, Reduction }
