//! Convex pieces of the shapes of a scene, and the pairs of pieces that may touch.

use super::super::carrier::Carrier;
use super::super::inverse_weight::Reference;
use super::reference;
use crate::description::{ContactPair, Description, Joint, Precompiled, Robot};
use crate::error::ModelError;
use crate::geom_contact::{ContactOverride, GeomContact};
use crate::geometry::{Hull, Shape};
use crate::hull_tables;
use crate::joint_kind::JointKind;
use crate::pose::Pose;
use crate::softness::Softness;
use crate::surface::Surface;
use crate::value_checks::within;
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Contacts, Kind, Solid};
use sim_physics::constants::height_field::FIELD_CONTACTS;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A shape of the scene, with what carries it.
pub(in crate::compile) struct PlacedShape<'a> {
    /// Its number among the scene's.
    pub number: usize,
    /// Its geometry and surface; its pose is that in the link.
    pub shape: &'a Shape,
    /// How it touches.
    pub surface: Surface,
    /// How it touches where it is a geom of MuJoCo's.
    pub geom: Option<&'a GeomContact>,
    /// The link of its robot.
    pub own_link: usize,
    /// Its place among the shapes of that link.
    pub place: usize,
    /// Its robot, if it is not static.
    pub robot: Option<usize>,
    /// The first link of the part of its robot that it belongs to.
    pub part: usize,
    /// Its link, as a frame.
    pub link: Option<usize>,
    /// The body that it moves with.
    pub body: Option<usize>,
    /// A number that it shares with the links it is fixed to.
    pub group: usize,
    /// Its frame in the body's, or in the world.
    pub pose: Pose,
}

impl PlacedShape<'_> {
    /// MuJoCo's priority: of two geoms, the parameters of the higher one count.
    pub fn priority(&self) -> i64 {
        self.geom.map_or(0, |geom| geom.priority)
    }

    /// Torsional and rolling friction [m], which counts in contacts with geoms of MuJoCo's.
    pub fn turning_mu(&self) -> [f64; 2] {
        let [_, twist, roll] = geom_of(self).friction;
        [twist, roll]
    }

    /// MuJoCo's `solref` and `solimp`.
    pub fn softness(&self) -> Softness {
        geom_of(self).softness
    }
}

/// What decides, besides the shapes, which pairs touch.
pub(in crate::compile) struct Rules<'a> {
    /// Groups of links that a joint connects.
    pub connected: Vec<(usize, usize)>,
    /// Robots whose links touch each other.
    pub self_collisions: Vec<bool>,
    /// Translational inverse weight of each link.
    pub link_inverse_weight: &'a [f64],
    /// Of each robot, what it has if it comes compiled.
    pub precompiled: Vec<Option<&'a Precompiled>>,
}

impl<'a> Rules<'a> {
    /// Pairs of geoms that models name.
    pub fn pairs(&self) -> impl Iterator<Item = &'a ContactPair> + use<'a, '_> {
        let precompiled = self.precompiled.iter().flatten();
        precompiled.flat_map(|parts| &parts.pairs)
    }

    pub fn new(
        scene: &'a Description,
        carriers: &[Vec<Carrier>],
        m: &Constants<f64>,
        reference: &'a Reference,
    ) -> Rules<'a> {
        let robots = scene.robots.iter();
        Rules {
            connected: connected(scene, carriers, m),
            self_collisions: robots.clone().map(|robot| robot.self_collisions).collect(),
            link_inverse_weight: &reference.link_inverse_weight,
            precompiled: robots.map(|robot| robot.precompiled.as_deref()).collect(),
        }
    }
}

/// How a shape touches a geom of MuJoCo's.
pub(super) fn geom_of(shape: &PlacedShape<'_>) -> GeomContact {
    match shape.geom {
        Some(geom) => *geom,
        None => GeomContact::from_surface(&shape.surface),
    }
}

/// A convex piece of a shape.
pub(super) struct Piece {
    /// Its shape, as a place among those that are placed.
    pub shape: usize,
    /// What the kernel source reads of it.
    pub solid: Solid<f64>,
    /// As its kind has it [m].
    pub size: [f64; 3],
    /// Of the ball around its centre [m].
    pub radius: f64,
    /// Its row in the table of hulls or of height fields, if it is one.
    pub hull: usize,
}

/// Most contacts of two shapes: end points and the nearest point between them, or corners of the area that two faces
/// share.
pub(super) fn contacts_of(kinds: (Kind, Kind)) -> usize {
    match kinds {
        (Kind::Field, _) => FIELD_CONTACTS,
        (Kind::Sphere, _) | (Kind::Plane, Kind::Sphere) => 1,
        (Kind::Ellipsoid, _) | (_, Kind::Ellipsoid) => 1,
        (Kind::Plane, Kind::Capsule) => 2,
        (Kind::Capsule, Kind::Capsule) => 2,
        (Kind::Capsule, _) => 3,
        (Kind::Box, Kind::Box) => 8,
        _ => 4,
    }
}

/// Group of a link: the number of its body, or one number for all static links of a robot.
fn group(constants: &Constants<f64>, robot: usize, carrier: &Carrier) -> usize {
    carrier.body.unwrap_or(constants.bodies.len() + robot)
}

/// All shapes of a scene, in the order of their names.
pub(in crate::compile) fn placed_shapes<'a>(
    scene: &'a Description,
    carriers: &[Vec<Carrier>],
    constants: &Constants<f64>,
) -> Vec<PlacedShape<'a>> {
    let mut all: Vec<PlacedShape<'a>> = Vec::new();
    for shape in &scene.shapes {
        all.push(PlacedShape {
            number: all.len(),
            shape: &shape.shape,
            surface: shape.surface,
            geom: None,
            own_link: 0,
            place: 0,
            robot: None,
            part: 0,
            link: None,
            body: None,
            group: constants.bodies.len() + scene.robots.len(),
            pose: shape.pose,
        });
    }
    let mut frame = 0;
    for (index, robot) in scene.robots.iter().enumerate() {
        for link in robot.link_order() {
            let carrier = &carriers[index][link];
            for (place, collision) in robot.links[link].collisions.iter().enumerate() {
                let mut pose = carrier.pose.mul(&collision.pose);
                if carrier.body.is_none() {
                    for (x, base) in pose.pos.iter_mut().zip(constants.trees[carrier.tree].base) {
                        *x += base;
                    }
                }
                all.push(PlacedShape {
                    number: all.len(),
                    shape: &collision.shape,
                    surface: collision.surface,
                    geom: collision.geom.as_ref(),
                    own_link: link,
                    place,
                    robot: Some(index),
                    part: part(robot, &carriers[index], link),
                    link: Some(frame),
                    body: carrier.body,
                    group: group(constants, index, carrier),
                    pose,
                });
            }
            frame += 1;
        }
    }
    all
}

/// Whether a joint lets its link move away from a link that stands still: then the two are as two robots.
fn parts_from_fixed(joint: &Joint, carriers: &[Carrier]) -> bool {
    let stands = joint
        .parent
        .is_some_and(|parent| carriers[parent].body.is_none());
    stands && matches!(joint.kind, JointKind::Free | JointKind::Planar)
}

/// The first link of the part of a robot that a link belongs to.
fn part(robot: &Robot, carriers: &[Carrier], link: usize) -> usize {
    let mut first = link;
    while let Some(joint) = robot.joints.iter().find(|joint| joint.child == first)
        && !parts_from_fixed(joint, carriers)
        && let Some(parent) = joint.parent
    {
        first = parent;
    }
    first
}

/// Groups of links that a joint connects.
fn connected(
    scene: &Description,
    carriers: &[Vec<Carrier>],
    constants: &Constants<f64>,
) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    for (index, robot) in scene.robots.iter().enumerate() {
        let group_of = |link: usize| group(constants, index, &carriers[index][link]);
        let holds = |joint: &&Joint| joint.moves() && !parts_from_fixed(joint, &carriers[index]);
        for joint in robot.joints.iter().filter(holds) {
            if let Some(parent) = joint.parent {
                pairs.push((group_of(parent), group_of(joint.child)));
            }
        }
    }
    pairs
}

/// The pieces of all shapes; their hulls go to the tables.
pub(super) fn pieces(
    scene: &Description,
    shapes: &[PlacedShape<'_>],
    contacts: &mut Contacts<f64>,
) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut hulls: Vec<Hull> = Vec::new();
    let mut fields = 0;
    for (index, b) in shapes.iter().enumerate() {
        let (kind, size, radius) = match b.shape {
            Shape::Plane => (Kind::Plane, [0.0; 3], 0.0),
            Shape::HeightField(_) => {
                pieces.push(piece(index, b, Kind::Field, b.pose, [0.0; 3], 0.0, fields));
                fields += 1;
                continue;
            }
            Shape::Sphere { radius } => (Kind::Sphere, [*radius, 0.0, 0.0], *radius),
            Shape::Capsule {
                radius,
                half_height,
            } => (
                Kind::Capsule,
                [*radius, *half_height, 0.0],
                radius + half_height,
            ),
            Shape::Box { half_extents } => {
                let square: f64 = half_extents.iter().map(|h| h * h).sum();
                (Kind::Box, *half_extents, square.sqrt())
            }
            Shape::Cylinder {
                radius,
                half_height,
            } => (
                Kind::Cylinder,
                [*radius, *half_height, 0.0],
                libm::hypot(*radius, *half_height),
            ),
            Shape::Ellipsoid { radii } => {
                let longest = radii.iter().copied().fold(0.0, f64::max);
                (Kind::Ellipsoid, *radii, longest)
            }
            Shape::Mesh(mesh) => {
                for hull in &mesh.hulls {
                    pieces.push(piece(
                        index,
                        b,
                        Kind::Hull,
                        b.pose,
                        [0.0; 3],
                        0.0,
                        hulls.len(),
                    ));
                    hulls.push(hull.clone());
                }
                continue;
            }
        };
        pieces.push(piece(index, b, kind, b.pose, size, radius, 0));
    }
    let touches = |kind: Kind, of_mujoco: bool| {
        let mut of = pieces.iter().filter(|piece| piece.solid.kind == kind);
        of.any(|piece| !of_mujoco || shapes[piece.shape].geom.is_some())
    };
    // one rule for all pairs of planes and hulls
    let is_mujocos = touches(Kind::Plane, true) || touches(Kind::Hull, true);
    let with_fans = is_mujocos && touches(Kind::Plane, false);
    let (tables, frames) = hull_tables::append(&hulls, with_fans, &mut contacts.tables);
    contacts.hulls = tables;
    let centers = frames.iter().map(|frame| frame.center);
    contacts.reference = Arc::new(reference::search(scene, shapes, &hulls, centers));
    for piece in pieces
        .iter_mut()
        .filter(|piece| piece.solid.kind == Kind::Hull)
    {
        let frame = &frames[piece.hull];
        piece.solid.center = shapes[piece.shape].pose.transform(frame.center);
        piece.size = frame.half_extents;
        piece.radius = frame.radius;
    }
    pieces
}

fn piece(
    shape: usize,
    b: &PlacedShape<'_>,
    kind: Kind,
    pose: Pose,
    size: [f64; 3],
    radius: f64,
    hull: usize,
) -> Piece {
    let rows = pose.rotation();
    let axes = std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]));
    let [twist, roll] = b.turning_mu();
    let Softness { solref, solimp } = b.softness();
    let ([time, ratio], [d_min, d_max, width, midpoint, power]) = (solref, solimp);
    Piece {
        shape,
        solid: Solid {
            kind,
            shape: b.number,
            link: b.link,
            friction: [b.surface.mu, twist, roll],
            softness: [time, ratio, d_min, d_max, width, midpoint, power],
            body: b.body,
            axes,
            is_upright: axes == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            center: pose.pos,
        },
        size,
        radius,
        hull,
    }
}

/// Most pairs of convex pieces that may touch: their tables take some hundred bytes each, and each step reads them.
const PAIRS_MAX: usize = 1 << 20;

/// Pairs of pieces that may touch, the lower kind first.
///
/// # Errors
/// More of them than a model has room for.
pub(super) fn pairs(
    shapes: &[PlacedShape<'_>],
    pieces: &[Piece],
    rules: &Rules<'_>,
    filtered: &BTreeSet<[usize; 2]>,
) -> Result<Vec<(usize, usize)>, ModelError> {
    let mut pairs = Vec::new();
    let mut count = 0_usize;
    for (j, second) in pieces.iter().enumerate() {
        for (i, first) in pieces[..j].iter().enumerate() {
            let (a, b) = (&shapes[first.shape], &shapes[second.shape]);
            let numbers = [a.number.min(b.number), a.number.max(b.number)];
            if filtered.contains(&numbers) || !may_touch(a, b, rules) {
                continue;
            }
            count += 1;
            // the message says how many there are, and memory holds no more than can be used
            if count > PAIRS_MAX {
                continue;
            }
            pairs.push(match first.solid.kind <= second.solid.kind {
                true => (i, j),
                false => (j, i),
            });
        }
    }
    let rule = "at most 1048576 fit; use fewer shapes, give shapes that need not touch one group or a filter, or make a \
                terrain one height field";
    within(
        "the number of pairs of shapes that may touch",
        count as f64,
        PAIRS_MAX as f64,
        rule,
    )?;
    Ok(pairs)
}

/// Whether two geoms of one robot from MuJoCo may touch, as MuJoCo filters them.
fn geoms_may_touch(a: &PlacedShape<'_>, b: &PlacedShape<'_>, parts: &Precompiled) -> bool {
    let links = [a.own_link, b.own_link];
    let welds = links.map(|link| parts.welds[link]);
    let above = welds.map(|weld| parts.welds[parts.parents[weld]]);
    // the world is no parent
    let are_neighbours = !welds.contains(&0) && (welds[0] == above[1] || welds[1] == above[0]);
    let are_excluded = parts
        .excludes
        .iter()
        .any(|pair| *pair == links || *pair == [links[1], links[0]]);
    welds[0] != welds[1] && (parts.touches_parent || !are_neighbours) && !are_excluded
}

/// The rules of two geoms that MuJoCo's model names as a pair.
pub(super) fn named_pair<'a>(
    a: &PlacedShape<'_>,
    b: &PlacedShape<'_>,
    rules: &Rules<'a>,
) -> Option<&'a ContactPair> {
    rules.pairs().nth(named_pair_place(a, b, rules)?)
}

/// What the model of two geoms gives their contacts in place of their own parameters.
pub(super) fn overriding<'a>(
    a: &PlacedShape<'_>,
    b: &PlacedShape<'_>,
    rules: &Rules<'a>,
) -> Option<&'a ContactOverride> {
    let robot = a.robot.filter(|_| a.robot == b.robot)?;
    rules.precompiled[robot]?.contact_override.as_ref()
}

/// Place of two geoms among the pairs that models name.
pub(super) fn named_pair_place(
    a: &PlacedShape<'_>,
    b: &PlacedShape<'_>,
    rules: &Rules<'_>,
) -> Option<usize> {
    let robot = a.robot.filter(|_| a.robot == b.robot)?;
    let geoms = [a, b].map(|shape| (shape.own_link, shape.place));
    let mut pairs = rules.precompiled[robot]?.pairs.iter();
    let place = pairs.position(|pair| pair.geoms == geoms || pair.geoms == [geoms[1], geoms[0]])?;
    let before = rules.precompiled[..robot].iter().flatten();
    Some(before.map(|parts| parts.pairs.len()).sum::<usize>() + place)
}

fn may_touch(a: &PlacedShape<'_>, b: &PlacedShape<'_>, rules: &Rules<'_>) -> bool {
    let moves = a.body.is_some() || b.body.is_some();
    if a.geom.is_some() || b.geom.is_some() {
        if named_pair(a, b, rules).is_some() {
            return a.body != b.body;
        }
        let [first, second] = [a, b].map(|shape| geom_of(shape));
        let filter = match (a.robot, b.robot) {
            (Some(first), Some(second)) if first == second => rules.precompiled[first],
            _ => None,
        };
        let passes = filter.is_none_or(|parts| geoms_may_touch(a, b, parts));
        return moves && passes && first.meets(&second);
    }
    let is_one = a.group == b.group;
    let of_one_robot = a.robot.is_some() && a.robot == b.robot && a.part == b.part;
    let may_self = a.robot.is_some_and(|robot| rules.self_collisions[robot]);
    let neighbours = [(a.group, b.group), (b.group, a.group)];
    let connected = neighbours
        .iter()
        .any(|groups| rules.connected.contains(groups));
    moves && !is_one && (!of_one_robot || may_self) && !connected && a.surface.meets(&b.surface)
}
