//! The elements and attributes of URDF that take part in the physics.

/// An element URDF knows.
pub(super) struct Tag {
    pub name: &'static str,
    pub attributes: &'static [Attribute],
    pub children: &'static [(&'static Tag, Count)],
    /// Known, but without a part in the physics: neither looked into nor handed on.
    pub opaque: bool,
}

/// An attribute of such an element.
pub(super) struct Attribute {
    pub name: &'static str,
    pub kind: Kind,
    pub need: Need,
}

/// What an attribute holds.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Text,
    Number,
    /// A number that may be infinite, which then is the absence of a limit.
    Limit,
    Vector(usize),
}

/// Whether an attribute must be there.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Need {
    Required,
    Optional,
    /// urdf-rs asks for it, URDF does not: this value stands in.
    Otherwise(&'static str),
}

/// How often a child may come.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Count {
    One,
    AtMostOne,
    Any,
}

const fn required(name: &'static str, kind: Kind) -> Attribute {
    Attribute {
        name,
        kind,
        need: Need::Required,
    }
}

const fn optional(name: &'static str, kind: Kind) -> Attribute {
    Attribute {
        name,
        kind,
        need: Need::Optional,
    }
}

const fn tag(
    name: &'static str,
    attributes: &'static [Attribute],
    children: &'static [(&'static Tag, Count)],
) -> Tag {
    Tag {
        name,
        attributes,
        children,
        opaque: false,
    }
}

const fn opaque(name: &'static str) -> Tag {
    Tag {
        name,
        attributes: &[],
        children: &[],
        opaque: true,
    }
}

pub(super) static ROBOT: Tag = tag(
    "robot",
    &[
        optional("name", Kind::Text),
        optional("version", Kind::Text),
    ],
    &[
        (&LINK, Count::Any),
        (&JOINT, Count::Any),
        (&MATERIAL, Count::Any),
    ],
);
static LINK: Tag = tag(
    "link",
    &[required("name", Kind::Text)],
    &[
        (&INERTIAL, Count::AtMostOne),
        (&VISUAL, Count::Any),
        (&COLLISION, Count::Any),
    ],
);
static INERTIAL: Tag = tag(
    "inertial",
    &[],
    &[
        (&ORIGIN, Count::AtMostOne),
        (&MASS, Count::One),
        (&INERTIA, Count::One),
    ],
);
static MASS: Tag = tag("mass", &[required("value", Kind::Number)], &[]);
static INERTIA: Tag = tag(
    "inertia",
    &[
        required("ixx", Kind::Number),
        required("ixy", Kind::Number),
        required("ixz", Kind::Number),
        required("iyy", Kind::Number),
        required("iyz", Kind::Number),
        required("izz", Kind::Number),
    ],
    &[],
);
static ORIGIN: Tag = tag(
    "origin",
    &[
        optional("xyz", Kind::Vector(3)),
        optional("rpy", Kind::Vector(3)),
        optional("quat_xyzw", Kind::Vector(4)),
    ],
    &[],
);
static VISUAL: Tag = opaque("visual");
static MATERIAL: Tag = opaque("material");
static COLLISION: Tag = tag(
    "collision",
    &[optional("name", Kind::Text)],
    &[
        (&ORIGIN, Count::AtMostOne),
        (&GEOMETRY, Count::One),
        (&MATERIAL, Count::Any),
    ],
);
pub(super) static GEOMETRY: Tag = tag(
    "geometry",
    &[],
    &[
        (&BOX, Count::AtMostOne),
        (&SPHERE, Count::AtMostOne),
        (&CYLINDER, Count::AtMostOne),
        (&CAPSULE, Count::AtMostOne),
        (&MESH, Count::AtMostOne),
    ],
);
static BOX: Tag = tag("box", &[required("size", Kind::Vector(3))], &[]);
static SPHERE: Tag = tag("sphere", &[required("radius", Kind::Number)], &[]);
static CYLINDER: Tag = tag(
    "cylinder",
    &[
        required("radius", Kind::Number),
        required("length", Kind::Number),
    ],
    &[],
);
static CAPSULE: Tag = tag(
    "capsule",
    &[
        required("radius", Kind::Number),
        required("length", Kind::Number),
    ],
    &[],
);
static MESH: Tag = tag(
    "mesh",
    &[
        required("filename", Kind::Text),
        optional("scale", Kind::Vector(3)),
    ],
    &[],
);
static JOINT: Tag = tag(
    "joint",
    &[required("name", Kind::Text), required("type", Kind::Text)],
    &[
        (&ORIGIN, Count::AtMostOne),
        (&PARENT, Count::One),
        (&CHILD, Count::One),
        (&AXIS, Count::AtMostOne),
        (&LIMIT, Count::AtMostOne),
        (&DYNAMICS, Count::AtMostOne),
        (&MIMIC, Count::AtMostOne),
    ],
);
static PARENT: Tag = tag("parent", &[required("link", Kind::Text)], &[]);
static CHILD: Tag = tag("child", &[required("link", Kind::Text)], &[]);
static AXIS: Tag = tag("axis", &[required("xyz", Kind::Vector(3))], &[]);
static LIMIT: Tag = tag(
    "limit",
    &[
        optional("lower", Kind::Limit),
        optional("upper", Kind::Limit),
        optional("effort", Kind::Limit),
        Attribute {
            name: "velocity",
            kind: Kind::Limit,
            need: Need::Otherwise("0"),
        },
    ],
    &[],
);
static DYNAMICS: Tag = tag(
    "dynamics",
    &[
        optional("damping", Kind::Number),
        optional("friction", Kind::Number),
    ],
    &[],
);
static MIMIC: Tag = tag(
    "mimic",
    &[
        required("joint", Kind::Text),
        optional("multiplier", Kind::Number),
        optional("offset", Kind::Number),
    ],
    &[],
);
