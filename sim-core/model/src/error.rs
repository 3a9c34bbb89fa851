//! What can be wrong with a robot or a scene: each variant names the culprit and the cure.

use std::path::PathBuf;

/// A description that cannot become a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file that cannot be opened or read.
    #[error("{}: cannot be read: {reason}; give the path of an existing file", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: String,
    },

    /// A file beyond a limit of this program.
    #[error("{}: {what} exceeds the limit of {limit}; delete what is not the robot", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The quantity that is too large.
        what: &'static str,
        /// The largest value accepted, with its unit.
        limit: String,
    },

    /// XML that is not well formed, or that this program refuses to expand.
    #[error("{}:{line}:{column}: broken XML: {reason}", path.display())]
    Xml {
        /// The file.
        path: PathBuf,
        /// Line of the fault, from 1.
        line: u32,
        /// Column of the fault, from 1.
        column: u32,
        /// What the parser expected.
        reason: String,
    },

    /// Well-formed XML that is not a robot description.
    #[error("{}:{line}: {element}: {reason}", path.display())]
    Urdf {
        /// The file.
        path: PathBuf,
        /// Line of the element, from 1.
        line: u32,
        /// The element, such as ``<limit> of joint `elbow` ``.
        element: String,
        /// What is wrong, and the cure.
        reason: String,
    },

    /// What is wrong with a robot that a file describes.
    #[error("{}:{line}: {error}", path.display())]
    InFile {
        /// The file.
        path: PathBuf,
        /// Line of the link or joint, from 1.
        line: u32,
        /// What is wrong with it.
        error: Box<ModelError>,
    },

    /// A number that is not a number, or not finite.
    #[error("{what} is {value}; give a finite number")]
    NotFinite {
        /// Whose number it is.
        what: String,
        /// The value found.
        value: f64,
    },

    /// A number outside what is meaningful.
    #[error("{what} is {}; {rule}", number(*value))]
    OutOfRange {
        /// Whose number it is.
        what: String,
        /// The value found.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },

    /// More dofs than a model can have.
    #[error(
        "{owner} has {dofs} dofs, more than the {most} that are supported; fix joints that need not move, or split it"
    )]
    TooManyDofs {
        /// The robot, or the scene.
        owner: String,
        /// Its dofs.
        dofs: usize,
        /// The most it may have.
        most: usize,
    },

    /// An array of another length than the robot's number of dofs.
    #[error("robot `{robot}`: {field} has {got} values, the robot has {expected} {entries}")]
    JointValues {
        /// What has an entry each: `dofs` or `coordinates`.
        entries: &'static str,
        /// The robot.
        robot: String,
        /// The array.
        field: &'static str,
        /// Dofs of the robot.
        expected: usize,
        /// Values given.
        got: usize,
    },

    /// A name that is empty or holds a character with a meaning of its own.
    #[error("{what} name `{name}` is not usable: {rule}")]
    BadName {
        /// What bears the name.
        what: &'static str,
        /// The name.
        name: String,
        /// What a name must be.
        rule: &'static str,
    },

    /// Two things of one kind with one name.
    #[error("{owner}: two {what}s are named `{name}`; give each its own name")]
    DuplicateName {
        /// Where both are: the scene or a robot.
        owner: String,
        /// What they are.
        what: &'static str,
        /// The name.
        name: String,
    },

    /// A name that nothing of its kind has.
    #[error("{owner}: there is no {what} `{name}`; there are: {known}")]
    UnknownName {
        /// Where it was looked for, or by what.
        owner: String,
        /// What it should be.
        what: &'static str,
        /// The name.
        name: String,
        /// The names that exist, the first few.
        known: String,
    },

    /// A plane that is part of a link or body.
    #[error(
        "{what}: a plane has no end and thus no mass, nor has a height field, so neither link nor body bears one; add it to the scene as a static shape, or make it a box"
    )]
    PlaneBorne {
        /// The shape.
        what: String,
    },
    /// A height field that cannot be used: which one and why, with the cure.
    #[error("{0}: {1}")]
    HeightField(String, String),

    /// A robot without any link.
    #[error("robot `{robot}` has no links; a robot needs at least one <link>")]
    NoLinks {
        /// The robot.
        robot: String,
    },

    /// A joint that names a link which does not exist.
    #[error(
        "robot `{robot}`: joint `{joint}`: {role} link `{link}` does not exist; the links are {known}"
    )]
    UnknownLink {
        /// The robot.
        robot: String,
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The name that was asked for.
        link: String,
        /// The names that exist, the first few.
        known: String,
    },

    /// Links that hang from no joint, where there should be exactly one.
    #[error("robot `{robot}` has {} roots: {}; connect all but one of them to a parent by a joint", roots.len(), first_few(roots))]
    SeveralRoots {
        /// The robot.
        robot: String,
        /// The links without a parent.
        roots: Vec<String>,
    },

    /// A link that is the child of two joints.
    #[error(
        "robot `{robot}`: link `{link}` is the child of joints `{first}` and `{second}`; a link has one parent, so delete one of the two joints: URDF has no closed loops"
    )]
    TwoParents {
        /// The robot.
        robot: String,
        /// The link.
        link: String,
        /// The joint met first.
        first: String,
        /// The joint met next.
        second: String,
    },

    /// Links that follow one another in a circle.
    #[error(
        "robot `{robot}`: links {} hang from one another in a loop; delete one of their joints: a robot is a tree",
        first_few(links)
    )]
    LinkLoop {
        /// The robot.
        robot: String,
        /// The links of the loop, from parent to child.
        links: Vec<String>,
    },

    /// A joint axis without direction.
    #[error(
        "robot `{robot}`: joint `{joint}`: axis is zero; give it a direction in <axis xyz=\"…\"/>"
    )]
    ZeroAxis {
        /// The robot.
        robot: String,
        /// The joint.
        joint: String,
    },

    /// A range that ends before it begins.
    #[error(
        "robot `{robot}`: joint `{joint}`: lower limit {} is above upper limit {}; exchange them, or make the joint continuous",
        number(*lower),
        number(*upper)
    )]
    EmptyRange {
        /// The robot.
        robot: String,
        /// The joint.
        joint: String,
        /// Lower limit [rad or m].
        lower: f64,
        /// Upper limit [rad or m].
        upper: f64,
    },

    /// A quaternion far from unit length.
    #[error("{what}: quaternion has length {length}; give (x, y, z, w) of length 1")]
    Quaternion {
        /// Whose quaternion it is.
        what: String,
        /// Its length.
        length: f64,
    },

    /// An inertia with a principal moment below zero.
    #[error(
        "robot `{robot}`: link `{link}`: inertia has a negative principal moment, {} kg·m²; give a positive definite <inertia>",
        number(*moment)
    )]
    NegativeInertia {
        /// The robot.
        robot: String,
        /// The link.
        link: String,
        /// The moment [kg·m²].
        moment: f64,
    },

    /// Principal moments that no distribution of mass can have.
    #[error(
        "robot `{robot}`: link `{link}`: its largest principal moment of inertia is {ratio:.4} times the sum of the other two, which no body can have; mend <inertia>, or let it be balanced (strict off, or balance_inertias())"
    )]
    InertiaTriangle {
        /// The robot.
        robot: String,
        /// The link.
        link: String,
        /// Largest principal moment over the sum of the others.
        ratio: f64,
    },

    /// A moving body that weighs nothing, together with all that is fixed to it.
    #[error(
        "robot `{robot}`: link `{link}` is moved by joint `{joint}` but has no {lacks}, nor has any link fixed to it; add <inertial> with a positive mass and inertia"
    )]
    Massless {
        /// The robot.
        robot: String,
        /// The link.
        link: String,
        /// The joint that moves it.
        joint: String,
        /// `mass` or `inertia`.
        lacks: &'static str,
    },

    /// A body of the scene without mass.
    #[error("body `{body}` {problem}")]
    BodyMass {
        /// The body.
        body: String,
        /// What is wrong, and the cure.
        problem: &'static str,
    },

    /// A joint that meets no inertia at the reference pose.
    #[error(
        "joint `{joint}`: what it moves has no inertia about its axis at q = 0; give its links mass away from the axis, or the joint an armature"
    )]
    NoInertia {
        /// `robot/joint`.
        joint: String,
    },

    /// A mass matrix that cannot be factored.
    #[error(
        "the mass matrix at q = 0 is singular; give every moving link a positive mass and inertia, or its joint an armature"
    )]
    SingularMass,

    /// A joint built by code, with lists that do not fit its kind.
    #[error(
        "{what}: a {kind:?} joint has {coords} positions in `q` and {dofs} dofs in `dofs`; make it with Joint::new"
    )]
    JointParts {
        /// The joint.
        what: String,
        /// Its kind.
        kind: crate::joint_kind::JointKind,
        /// Positions that it has.
        coords: usize,
        /// Dofs that it has.
        dofs: usize,
    },

    /// A free joint that hangs from something that moves.
    #[error(
        "robot `{robot}`: joint `{joint}` is floating, but joint `{carrier}` above it moves; let it hang from the root, since a free body is carried by the world alone"
    )]
    FreeBelow {
        /// The robot.
        robot: String,
        /// The free joint.
        joint: String,
        /// A moving joint above it.
        carrier: String,
    },

    /// Gains on a free joint.
    #[error(
        "robot `{robot}`: joint `{joint}` is free and cannot be driven; leave its gains and targets at 0, and push it with joint_f"
    )]
    FreeDrive {
        /// The robot.
        robot: String,
        /// The free joint.
        joint: String,
    },

    /// A mimic joint whose leader does not exist or does not move.
    #[error(
        "robot `{robot}`: joint `{joint}`: mimics `{leader}`, which {reason}; name another moving joint in <mimic joint=\"…\"/>"
    )]
    MimicLeader {
        /// The robot.
        robot: String,
        /// The follower.
        joint: String,
        /// The joint it names.
        leader: String,
        /// Why this cannot be.
        reason: &'static str,
    },

    /// A follower with an offset of its own.
    #[error(
        "robot `{robot}`: joint `{joint}` mimics `{leader}` and starts where that does; give `{leader}` the offset"
    )]
    FollowerOffset {
        /// The robot.
        robot: String,
        /// The follower.
        joint: String,
        /// The joint it follows.
        leader: String,
    },

    /// A uniform distribution without numbers.
    #[error("{what}: low is {low} and high is {high}; low must not be above high")]
    EmptyUniform {
        /// Whose distribution it is.
        what: String,
        /// The lower end.
        low: f64,
        /// The upper end.
        high: f64,
    },

    /// A range of a parameter that its numbers cannot be drawn from.
    #[error("{culprit}: {problem}")]
    ParamRange {
        /// The entry.
        culprit: String,
        /// What is wrong, and the cure.
        problem: String,
    },

    /// Joints that mimic one another in a circle.
    #[error(
        "robot `{robot}`: joints {} mimic one another in a circle; let one of them lead",
        first_few(joints)
    )]
    MimicLoop {
        /// The robot.
        robot: String,
        /// The joints of the circle.
        joints: Vec<String>,
    },
    /// A mesh file that cannot be used.
    #[error("{owner}mesh {}: {reason}", path.display())]
    Mesh {
        /// What has it, such as ``robot `arm`: link `hand`: ``; empty for a mesh on its own.
        owner: String,
        /// The file.
        path: PathBuf,
        /// What is wrong, and the cure.
        reason: String,
    },

    /// A file that is no compiled MuJoCo model, or a broken one.
    #[error("{}: {reason}", path.display())]
    MujocoFile {
        /// The file.
        path: PathBuf,
        /// What is wrong, and the cure.
        reason: String,
    },

    /// A MuJoCo model with elements that are not supported.
    #[error("{reasons}")]
    MujocoRefused {
        /// What is refused, the first few of many.
        reasons: String,
    },

    /// A collision mesh that is not there.
    #[error(
        "robot `{robot}`: link `{link}`: collision mesh `{uri}` is missing: looked for {}; copy it there or mend the path",
        list_paths(tried)
    )]
    MissingMesh {
        /// The robot.
        robot: String,
        /// The link.
        link: String,
        /// The path as the file gives it.
        uri: String,
        /// The places looked at.
        tried: Vec<PathBuf>,
    },
}

/// Most names in a message: enough to see the slip, not a page of them.
const LISTED_MAX: usize = 8;

/// The first few names in quotes, joined by commas; `none` where there are none.
pub(crate) fn first_few(names: &[impl AsRef<str>]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let shown = names.iter().take(LISTED_MAX);
    let quoted: Vec<String> = shown.map(|name| format!("`{}`", name.as_ref())).collect();
    let more = if names.len() > LISTED_MAX {
        ", …"
    } else {
        ""
    };
    quoted.join(", ") + more
}

/// A number as people write it: `1e200` is not spelled out.
fn number(value: f64) -> String {
    let plain = value == 0.0 || !value.is_finite() || (1e-4..1e7).contains(&value.abs());
    match plain {
        true => format!("{value}"),
        false => format!("{value:e}"),
    }
}

/// Paths in quotes, joined by commas.
fn list_paths(paths: &[PathBuf]) -> String {
    let names: Vec<String> = paths
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    first_few(&names)
}
