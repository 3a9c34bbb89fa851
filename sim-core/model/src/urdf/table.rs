//! The elements and attributes of URDF that take part in the physics.

/// An element of URDF.
pub(super) struct Tag {
    pub name: &'static str,
    pub attributes: &'static [Attribute],
    pub children: &'static [(&'static Tag, Count)],
    /// Known, but without a part in the physics: the walk does not enter it.
    pub opaque: bool,
}

/// An attribute of such an element.
pub(super) struct Attribute {
    pub name: &'static str,
    pub kind: Kind,
    pub need: Need,
    pub sign: Sign,
}

/// Which signs its numbers may have.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Sign {
    Any,
    NotNegative,
    Positive,
}

impl Attribute {
    const fn not_negative(self) -> Attribute {
        Attribute {
            sign: Sign::NotNegative,
            ..self
        }
    }

    const fn positive(self) -> Attribute {
        Attribute {
            sign: Sign::Positive,
            ..self
        }
    }
}

/// What an attribute holds.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Kind {
    /// What something is called.
    Name,
    Path,
    Number,
    /// A number that may be infinite, which then is the absence of a limit.
    Limit,
    /// Three numbers.
    Vector,
    /// Three angles [rad].
    Angles,
    /// Four numbers, x, y, z, w.
    Quaternion,
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
        sign: Sign::Any,
    }
}

const fn optional(name: &'static str, kind: Kind) -> Attribute {
    Attribute {
        name,
        kind,
        need: Need::Optional,
        sign: Sign::Any,
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
        optional("name", Kind::Name),
        optional("version", Kind::Name),
    ],
    &[
        (&LINK, Count::Any),
        (&JOINT, Count::Any),
        (&MATERIAL, Count::Any),
    ],
);
static LINK: Tag = tag(
    "link",
    &[required("name", Kind::Name)],
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
static MASS: Tag = tag(
    "mass",
    &[required("value", Kind::Number).not_negative()],
    &[],
);
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
pub(super) static ORIGIN: Tag = tag(
    "origin",
    &[
        optional("xyz", Kind::Vector),
        optional("rpy", Kind::Angles),
        optional("quat_xyzw", Kind::Quaternion),
    ],
    &[],
);
static VISUAL: Tag = opaque("visual");
static MATERIAL: Tag = opaque("material");
static COLLISION: Tag = tag(
    "collision",
    &[optional("name", Kind::Name)],
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
static BOX: Tag = tag("box", &[required("size", Kind::Vector).positive()], &[]);
static SPHERE: Tag = tag(
    "sphere",
    &[required("radius", Kind::Number).positive()],
    &[],
);
static CYLINDER: Tag = tag(
    "cylinder",
    &[
        required("radius", Kind::Number).positive(),
        required("length", Kind::Number).positive(),
    ],
    &[],
);
static CAPSULE: Tag = tag(
    "capsule",
    &[
        required("radius", Kind::Number).positive(),
        required("length", Kind::Number).positive(),
    ],
    &[],
);
static MESH: Tag = tag(
    "mesh",
    &[
        required("filename", Kind::Path),
        optional("scale", Kind::Vector),
    ],
    &[],
);
static JOINT: Tag = tag(
    "joint",
    &[required("name", Kind::Name), required("type", Kind::Name)],
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
static PARENT: Tag = tag("parent", &[required("link", Kind::Name)], &[]);
static CHILD: Tag = tag("child", &[required("link", Kind::Name)], &[]);
static AXIS: Tag = tag("axis", &[required("xyz", Kind::Vector)], &[]);
static LIMIT: Tag = tag(
    "limit",
    &[
        optional("lower", Kind::Limit),
        optional("upper", Kind::Limit),
        optional("effort", Kind::Limit).not_negative(),
        Attribute {
            name: "velocity",
            kind: Kind::Limit,
            need: Need::Otherwise("0"),
            sign: Sign::NotNegative,
        },
    ],
    &[],
);
static DYNAMICS: Tag = tag(
    "dynamics",
    &[
        optional("damping", Kind::Number).not_negative(),
        optional("friction", Kind::Number).not_negative(),
    ],
    &[],
);
static MIMIC: Tag = tag(
    "mimic",
    &[
        required("joint", Kind::Name),
        optional("multiplier", Kind::Number),
        optional("offset", Kind::Number),
    ],
    &[],
);

/// Elements that weigh, touch or move, and the one that holds each: anywhere else they would be lost.
pub(super) const PLACES: [(&str, &str); 18] = [
    ("link", "<robot>"),
    ("joint", "<robot>"),
    ("inertial", "<link>"),
    ("collision", "<link>"),
    ("mass", "<inertial>"),
    ("inertia", "<inertial>"),
    ("geometry", "<collision> or <visual>"),
    ("box", "<geometry>"),
    ("sphere", "<geometry>"),
    ("cylinder", "<geometry>"),
    ("capsule", "<geometry>"),
    ("mesh", "<geometry>"),
    ("parent", "<joint>"),
    ("child", "<joint>"),
    ("axis", "<joint>"),
    ("limit", "<joint>"),
    ("dynamics", "<joint>"),
    ("mimic", "<joint>"),
];
