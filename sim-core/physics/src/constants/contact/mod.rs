//! Shapes of a model as physics code reads them: where they are, which pairs may touch, and how soft they are.

mod friction;

pub use friction::{FrictionCombine, rule};

use super::Impedance;
use super::clip::Cut;
use super::height_field::FieldTables;
use super::hull::HullTables;
use super::hull::reference::ReferenceSearch;
use super::pair_groups::Group;
pub use super::pair_groups::{Kind, PAIR_KINDS};
use super::recast::{Recast, recast, same};
use super::rolled::RolledSystem;
use crate::lane::{Fixed, Real, Table, Tables};
use crate::math::factor::UpdatePath;
use std::sync::Arc;

/// Shape of the friction cone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cone {
    /// The cone of Coulomb's law.
    #[default]
    Elliptic,
    /// A pyramid inside it.
    Pyramidal,
}

recast! {
    /// Shapes, the pairs of them that may touch, and the classes of contacts.
    #[derive(Clone, Debug)]
    pub struct Contacts<R> {
        /// Shape of the friction cone.
        pub cone: Cone,
        /// Friction impedance over normal impedance [–].
        pub impratio: R,
        /// Are contacts so stiff that single precision loses the mass matrix beside them?
        pub are_stiff: bool,
        /// Shapes that some pair has.
        pub solids: Vec<Solid<R>>,
        /// Pairs by kinds.
        pub groups: Vec<Group>,
        /// Contacts by the bodies that they may be of.
        pub classes: Vec<Class<R>>,
        /// Pairs, in the order of the tables.
        pub pairs: Vec<Pair>,
        /// Contacts that a world has room for.
        pub contacts_max: usize,
        /// Rows that they may have.
        pub rows_max: usize,
        /// Can there be more contacts than there is room for?
        pub may_overflow: bool,
        /// Scalars and indices of pairs and hulls.
        pub tables: Tables<R>,
        /// Where they are.
        pub handles: Handles,
        /// Where the hulls are.
        pub hulls: HullTables,
        /// Where the height fields are.
        pub fields: FieldTables,
        /// Where the stages keep what they find.
        pub memory: Memory,
        /// Do programs read first rows and capacities of classes when they run? Then worlds can get more room, up to that of `classes`.
        pub room_grows: bool,
        /// Where loops solve the system, in recorded programs of models with many dofs.
        pub rolled: Option<RolledSystem>,
        /// Of each pair, torsional and rolling friction over sliding friction; without rows where no pair has any.
        pub turning: Fixed,
        /// How friction differs between the tangents of each pair ([`skew`]); without rows where it differs in none.
        pub skew: Fixed,
        /// How the surfaces of each pair's shapes move beside the shapes ([`surface_velocity`]); without rows where none does.
        pub surface_velocities: Fixed,
        /// Forces by which each pair's contacts pull ([`adhesion`]); without rows where none does.
        pub adhesion: Fixed,
        /// How the friction of two shapes combines.
        pub combine: FrictionCombine,
        /// Of each pair, which friction counts ([`rule`]); without rows where all combine, or all have the larger one.
        pub keeps_max: Fixed,
        /// Whether friction of some pairs follows a rule beyond [`rule::LARGER`].
        pub has_rules: bool,
        /// What of contacts differs from world to world.
        pub varying: VaryingSurfaces,
        /// How the softness of two shapes combines, where it varies; see [`mixing`].
        pub mixing: Fixed,
        /// Row of each contact pair that models name in the table of surfaces, where its friction varies; 0 of other pairs.
        pub named_pairs: Fixed,
        /// Whether capsules and boxes have the points of `collide::primitive::capsule_box`.
        pub two_point_capsule_boxes: bool,
        /// Whether the corners of a box on a plane or on a box are in MuJoCo's order, which matters where contacts are swept.
        pub ordered_corners: bool,
        /// MuJoCo's search for contacts.
        pub reference: Arc<ReferenceSearch>,
        /// Impedances of pairs.
        pub impedances: PairImpedances<R>,
        /// Bodies that contacts act on, among those of outputs.
        pub bodies: TouchedBodies,
    }
}

/// Scalars of surfaces and bodies that differ from world to world, where some contact needs them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VaryingSurfaces {
    /// Sliding friction.
    pub mu: bool,
    /// Torsional and rolling friction.
    pub turning: bool,
    /// Inverse weights of bodies.
    pub weight: bool,
    /// `solref` and `solimp`.
    pub softness: bool,
    /// Friction of contact pairs that models name.
    pub pairs: bool,
}

impl VaryingSurfaces {
    /// Does any of them vary?
    pub fn any(self) -> bool {
        self.mu || self.turning || self.weight || self.softness
    }

    /// Columns of the table of surfaces: sliding friction is the first.
    pub fn columns(self) -> usize {
        match (self.softness, self.turning || self.weight) {
            (true, _) => surface::COLUMNS,
            (_, true) => surface::SOFTNESS,
            _ => 1,
        }
    }

    /// Kinds of friction in that table, of which sliding is the first.
    pub fn frictions(self) -> usize {
        match self.turning {
            true => surface::WEIGHT,
            false => 1,
        }
    }
}

/// Columns of the table of surfaces, which has a row per solid.
pub mod surface {
    /// Coefficient of sliding friction [–].
    pub const MU: usize = 0;
    /// Coefficient of torsional friction [m].
    pub const TORSION: usize = 1;
    /// Coefficient of rolling friction [m].
    pub const ROLLING: usize = 2;
    /// Inverse weight of the body [1/kg].
    pub const WEIGHT: usize = 3;
    /// MuJoCo's `solref` and `solimp`.
    pub const SOFTNESS: usize = 4;
    /// Scalars of `solref`.
    pub const SOLREF: usize = 2;
    /// Scalars of `solimp`.
    pub const SOLIMP: usize = 5;
    /// Columns.
    pub const COLUMNS: usize = SOFTNESS + SOLREF + SOLIMP;
}

/// Columns of the table of pairs by which the softness of two shapes becomes that of their contacts.
pub mod mixing {
    /// Share of the first shape in a mixture [–].
    pub const SHARE: usize = 0;
    /// Whose softness counts; see [`super::rule`].
    pub const RULE: usize = 1;
    /// 1 where friction keeps the damping of the scene, else 0.
    pub const KEEPS_SLIDING: usize = 2;
    /// Least time constant [s].
    pub const LEAST_TIME: usize = 3;
    /// Impedance of the pair in the scene: `d_min`, `d_max`, 1 / width, midpoint.
    pub const IMPEDANCE: usize = 4;
    /// Columns.
    pub const COLUMNS: usize = 8;
}

/// Scalars of a contact's softness, where that varies: as in [`pair`] from its stiffness on, then the impedance.
pub mod soft {
    /// `d_min`, `d_max`, 1 / width, midpoint.
    pub const IMPEDANCE: usize = 3;
    /// Columns.
    pub const COLUMNS: usize = 7;
}

/// Columns of the table of pairs whose friction differs between the tangents.
pub mod skew {
    /// Sliding friction along the second tangent over that along the first, which scales the second tangent itself [–].
    pub const SLIDE: usize = 0;
    /// Rolling friction about the second tangent over that about the first, and over `SLIDE` [–].
    pub const ROLL: usize = 1;
    /// Columns.
    pub const COLUMNS: usize = 2;
}

/// Columns of the table of pairs whose surfaces move beside their shapes, as belts do.
pub mod surface_velocity {
    /// Of one shape: velocity at its centre [m/s], then angular velocity [rad/s], in its axes.
    pub const OF_SHAPE: usize = 6;
    /// Columns: those of the first, then of the second shape.
    pub const COLUMNS: usize = 2 * OF_SHAPE;
}

/// Columns of the table of pairs whose contacts pull.
pub mod adhesion {
    /// Force of a contact [N].
    pub const FORCE: usize = 0;
    /// Its share in each row that the normal force is the sum of, where a contact has friction [N].
    pub const ROW: usize = 1;
    /// The same where it has none [N].
    pub const ROW_IN_GAP: usize = 2;
    /// Columns.
    pub const COLUMNS: usize = 3;
}

recast! {
    /// Impedances of contacts where pairs differ; all empty where all have `Constants::contact_impedance`.
    #[derive(Clone, Debug)]
    pub struct PairImpedances<R> {
        /// Impedances, each once.
        pub all: Vec<Impedance<R>>,
        /// Of each pair of shapes, its place among them: a table with one column.
        pub of_pair: Fixed,
        /// Of each class of contacts, those that its pairs have.
        pub of_classes: Vec<Vec<usize>>,
    }
}

/// Bodies that contacts act on; all empty where no output asks for them.
#[derive(Clone, Debug, Default)]
pub struct TouchedBodies {
    /// Of each pair of shapes, the bodies of its two sides as places in the list of its class, from 1; 0 for none.
    pub of_pair: Fixed,
    /// Of each class of contacts, the bodies that its contacts act on.
    pub of_classes: Vec<Vec<usize>>,
}

impl<R> Default for PairImpedances<R> {
    fn default() -> PairImpedances<R> {
        PairImpedances {
            all: Vec::new(),
            of_pair: Fixed::default(),
            of_classes: Vec::new(),
        }
    }
}

/// Tables of the model.
#[derive(Clone, Copy, Debug, Default)]
pub struct Handles {
    /// Scalars of a pair; see [`pair`].
    pub pair_numbers: Fixed,
    /// Indices of a pair; see [`pair`].
    pub pair_indices: Fixed,
    /// First row and capacity of a class.
    pub class_rows: Fixed,
    /// Blocks of pairs of the same kinds: each has [`super::pair_groups::BLOCK`] pairs, the last one as often as it takes, and the pair after its last.
    /// Without rows where pairs are tested one by one.
    pub pair_blocks: Fixed,
}

/// Scratch tables.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Axes (9) [–] and centre relative to the reference point of its tree (3) [m] of each solid.
    pub poses: Table,
    /// Reference point of each tree, and at last the world's origin [m].
    pub origins: Table,
    /// Contacts of each class; then contacts, rows, and contacts left out of the world.
    pub counts: Table,
    /// A row per contact; see [`row`].
    pub rows: Table,
    /// Scratch of the narrow phase of faces.
    pub cut: Cut,
    /// Candidates for contacts with a height field; see `row`.
    pub field_candidates: Table,
    /// Cells of a height field under a shape that reach its lowest point.
    pub field_cells: Table,
    /// Prisms of a height field that a shape may touch.
    pub field_prisms: Table,
    /// What varies of each solid; see [`surface`].
    pub mu: Table,
    /// Scalars of all tables.
    pub len: usize,
}

recast! {
    /// A shape of a body, or a static one.
    #[derive(Clone, Debug)]
    pub struct Solid<R> {
        /// What it is.
        pub kind: Kind,
        /// Its shape, as in `shape_names`.
        pub shape: usize,
        /// Its link, as in `body_names`; none of a static shape.
        pub link: Option<usize>,
        /// Coefficients of sliding [–], torsional and rolling friction [m].
        pub friction: [R; 3],
        /// MuJoCo's `solref`, then `solimp`.
        pub softness: [R; 7],
        /// The body that carries it, or none.
        pub body: Option<usize>,
        /// Its axes in the body's frame, or in the world: columns [–].
        pub axes: [[R; 3]; 3],
        /// Are they those of the frame?
        pub is_upright: bool,
        /// Its centre in the body's frame, or in the world [m].
        pub center: [R; 3],
    }
}

/// A pair for output: places of its shapes in the model's list of shape names. The normal points from the first to the second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// The two shapes.
    pub shapes: [usize; 2],
    /// Their links, as in `body_names`; none of a static shape.
    pub links: [Option<usize>; 2],
    /// The class of its contacts.
    pub class: usize,
}

recast! {
    /// Contacts whose Jacobians have the same dofs as columns.
    #[derive(Clone, Debug)]
    pub struct Class<R> {
        /// Trees of the bodies on its two sides; the first is none where that side is static. Points are relative to the reference point
        /// of the second. The sides of a class that `mixes` have no trees of their own.
        pub trees: (Option<usize>, usize),
        /// May its contacts be of different trees, which the levers of pairs tell? Only classes of recorded programs do.
        pub mixes: bool,
        /// Its dofs, rising.
        pub columns: Vec<Column>,
        /// The same dofs, by runs.
        pub runs: Vec<Run>,
        /// Of each column, the entries of JᵀWJ with it and those before it that may differ from 0, by runs of columns whose
        /// places follow each other: in the mass matrix's pattern, or in that of couplings if the class couples.
        pub entries: Vec<Vec<Run>>,
        /// Does any entry lie outside the pattern of the mass matrix?
        pub couples: bool,
        /// What its contacts change of the factor of that matrix, from its columns.
        pub update_path: UpdatePath,
        /// Parts of the mass matrix that its columns are of, each once, as [`Pattern::parts`](crate::math::factor::Pattern::parts) counts them.
        pub parts: Vec<usize>,
        /// Scalars of a pair that are the same for all of its pairs.
        pub shared: Vec<Option<R>>,
        /// First row of its contacts.
        pub first: usize,
        /// Most contacts.
        pub capacity: usize,
        /// Where the second block of a contact's row begins, if any of its pairs has torsional friction; see [`turning`].
        pub turns: Option<usize>,
    }
}

/// A dof that moves bodies of a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// The dof.
    pub dof: usize,
    /// Is it of the first side's tree? Digests of models have it.
    pub is_first: bool,
    /// Its tree.
    pub tree: usize,
    /// Place of its lever among the scalars of a pair: how it moves the second body relative to the first, 1, -1 or 0.
    pub lever: usize,
}

/// Columns of a class, and what belongs to them, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// The first column.
    pub column: usize,
    /// Where what belongs to it is kept.
    pub place: usize,
    /// How many they are.
    pub len: usize,
}

impl Run {
    /// The runs of rising columns with their places.
    pub fn from_columns(columns: impl IntoIterator<Item = (usize, usize)>) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for (column, place) in columns {
            match runs.last_mut() {
                Some(run) if (run.column + run.len, run.place + run.len) == (column, place) => {
                    run.len += 1;
                }
                _ => runs.push(Run {
                    column,
                    place,
                    len: 1,
                }),
            }
        }
        runs
    }

    /// Its columns.
    pub fn columns(&self) -> std::ops::Range<usize> {
        self.column..self.column + self.len
    }

    /// Where what belongs to them is kept.
    #[inline(always)]
    pub fn places(&self) -> std::ops::Range<usize> {
        self.place..self.place + self.len
    }
}

/// Places of the scalars and indices of a pair.
pub mod pair {
    /// Distance below which contacts are found [m].
    pub const REACH: usize = 0;
    /// Radii around the centres, and the reach [m].
    pub const RADIUS: usize = 1;
    /// Radius around the first shape's centre, and the reach [m].
    pub const RADIUS_A: usize = 2;
    /// Radius around the second shape's centre, and the reach [m].
    pub const RADIUS_B: usize = 3;
    /// Radius around the centre of the smaller shape, a plane counting as large [m].
    pub const SMALLER: usize = 4;
    /// Size of the first shape (3) [m].
    pub const SIZE_A: usize = 5;
    /// Size of the second shape (3) [m].
    pub const SIZE_B: usize = 8;
    /// -1 where the first shape of the class's side is the pair's second, else 1.
    pub const FLIP: usize = 11;
    /// Distance below which a contact pushes [m].
    pub const MARGIN: usize = 12;
    /// Coefficient of friction [–].
    pub const MU: usize = 13;
    /// Inverse weight of both bodies [1/kg].
    pub const WEIGHT: usize = 14;
    /// Reference stiffness k [1/s²].
    pub const STIFFNESS: usize = 15;
    /// Reference damping b [1/s].
    pub const DAMPING: usize = 16;
    /// Reference damping of friction rows [1/s].
    pub const SLIDING: usize = 17;
    /// 1 with friction, 0 without.
    pub const RUBS: usize = 18;
    /// Constraint rows of a contact.
    pub const ROWS: usize = 19;
    /// First of the levers.
    pub const LEVERS: usize = 20;

    /// Index of the first shape among the solids.
    pub const SOLID_A: usize = 0;
    /// Index of the second shape among the solids.
    pub const SOLID_B: usize = 1;
    /// Row of the first shape's reference point.
    pub const ORIGIN_A: usize = 2;
    /// Row of the second shape's reference point.
    pub const ORIGIN_B: usize = 3;
    /// Row of the reference point that contacts of the class are relative to.
    pub const ORIGIN: usize = 4;
    /// The class.
    pub const CLASS: usize = 5;
    /// Hull of the first shape, if it is one; or its field.
    pub const HULL_A: usize = 6;
    /// Hull of the second shape, if it is one.
    pub const HULL_B: usize = 7;
    /// Indices of a pair.
    pub const INDICES: usize = 8;
}

/// Places of the scalars of a contact.
pub mod row {
    /// Point between the surfaces, relative to the reference point of the class's last tree (3) [m].
    pub const POINT: usize = 0;
    /// Distance of the surfaces [m].
    pub const DISTANCE: usize = 3;
    /// From the class's first side to its second (3) [–].
    pub const NORMAL: usize = 4;
    /// Index of the pair.
    pub const PAIR: usize = 7;
    /// Regularised stiffness D of the normal row, or of an edge of the pyramid [kg].
    pub const STIFFNESS: usize = 8;
    /// Coefficient of friction, 0 without [–].
    pub const MU: usize = 9;
    /// Reference acceleration: normal, two tangents [m/s²].
    pub const AREF: usize = 10;
    /// Until the reference acceleration is known: torsional and rolling friction [m], and inverse weight [1/kg], where they vary.
    pub const VARYING: usize = AREF;
    /// After these, where it varies, the contact's softness; see [`soft`](super::soft).
    pub const SOFTNESS: usize = VARYING + 3;
    /// J a - aref (3) [m/s²].
    pub const JAR: usize = 13;
    /// The same somewhere else, or its change (3) [m/s²].
    pub const AHEAD: usize = 16;
    /// Force along normal and tangents (3) [N].
    pub const FORCE: usize = 19;
    /// Tangents (6) [–].
    pub const TANGENTS: usize = 22;
    /// Stiffness of an elliptic cone's contact that slides, along its own slope [kg].
    pub const SOFT: usize = 28;
    /// Until the rows are written: velocity of the second surface relative to the first, beside that of the bodies (3) [m/s].
    pub const SURFACE_VELOCITY: usize = SOFT;
    /// And its angular velocity along the normal [rad/s].
    pub const SURFACE_SPIN: usize = SURFACE_VELOCITY + 3;
    /// Of an iteration of the solver: which piece of its cost the contact is on.
    pub const STATE: usize = 29;
    /// Of a line search: force times the change of `AHEAD` [N·m/s²].
    pub const POWER: usize = 30;
    /// Of a line search: stiffness times the square of that change [N·m/s²].
    pub const BEND: usize = 31;
    /// Of a line search, along the tangents: jar · jar, jar · `AHEAD`, `AHEAD` · `AHEAD` [m²/s⁴].
    pub const SQUARES: usize = 32;
    /// Jacobian: normal row, then tangents.
    pub const JACOBIAN: usize = 35;
}

/// Places in the second block of a contact's row, of the rotation about the normal and about the tangents.
pub mod turning {
    /// Reference acceleration (3) [rad/s²], scaled as the Jacobian.
    pub const AREF: usize = 0;
    /// J a - aref (3).
    pub const JAR: usize = 3;
    /// The same somewhere else, or its change (3).
    pub const AHEAD: usize = 6;
    /// Torque over the scale (3) [N·m].
    pub const FORCE: usize = 9;
    /// 1 for each rotation that has friction, else 0 (3).
    pub const EXISTS: usize = 12;
    /// Jacobian.
    pub const JACOBIAN: usize = 15;
}

/// Directions in which a contact pushes or rubs, at most.
pub const DIRECTIONS_MAX: usize = 6;

/// Least inverse weight of two bodies (MuJoCo: `mjMINVAL`) [1/kg].
pub const WEIGHT_MIN: f64 = 1e-15;

/// Least coefficient of friction of a contact that has any (MuJoCo: `mjMINMU`) [–].
pub const MU_MIN: f64 = 1e-5;

/// What follows the classes in `counts`.
pub const COUNT_CONTACTS: usize = 0;
/// Rows in use.
pub const COUNT_ROWS: usize = 1;
/// Contacts that did not fit.
pub const COUNT_LEFT_OUT: usize = 2;
/// Rows of `counts` after the classes.
pub const COUNTS: usize = 3;

impl<R> Contacts<R> {
    /// Bounds of the first rows and of the capacities of classes: for backends that check the indices of `class_rows`.
    #[inline(always)]
    pub fn row_ends(&self) -> [usize; 2] {
        let capacity = self.classes.iter().map(|class| class.capacity).max();
        let first = self.classes.last().map_or(0, |class| class.first);
        [first + 1, capacity.unwrap_or(0) + 1]
    }
}

impl<R: Real> Contacts<R> {
    /// None at all.
    pub fn none(cone: Cone, impratio: f64) -> Contacts<R> {
        let table = Table {
            base: 0,
            stride: 1,
            rows: 0,
        };
        Contacts {
            cone,
            impratio: R::from_f64(impratio),
            are_stiff: false,
            solids: Vec::new(),
            groups: Vec::new(),
            classes: Vec::new(),
            pairs: Vec::new(),
            contacts_max: 0,
            rows_max: 0,
            may_overflow: false,
            tables: Tables::default(),
            handles: Handles::default(),
            hulls: HullTables::default(),
            fields: FieldTables::default(),
            memory: Memory {
                poses: table,
                origins: table,
                counts: table,
                rows: table,
                mu: table,
                cut: Cut {
                    corners: table,
                    candidates: table,
                    edges: table,
                },
                field_candidates: table,
                field_cells: table,
                field_prisms: table,
                len: 0,
            },
            room_grows: false,
            rolled: None,
            turning: Fixed::default(),
            skew: Fixed::default(),
            surface_velocities: Fixed::default(),
            adhesion: Fixed::default(),
            combine: FrictionCombine::Max,
            keeps_max: Fixed::default(),
            has_rules: false,
            varying: VaryingSurfaces::default(),
            mixing: Fixed::default(),
            named_pairs: Fixed::default(),
            two_point_capsule_boxes: false,
            ordered_corners: false,
            reference: Arc::default(),
            impedances: PairImpedances::default(),
            bodies: TouchedBodies::default(),
        }
    }

    /// Do forces depend on the directions of the tangents?
    #[inline(always)]
    pub fn has_directions(&self) -> bool {
        self.cone == Cone::Pyramidal || self.skew.rows > 0
    }

    /// Does any class reach beyond the pattern of the mass matrix?
    #[inline(always)]
    pub fn couples(&self) -> bool {
        self.classes.iter().any(|class| class.couples)
    }
}

same! { VaryingSurfaces, Fixed, UpdatePath, Cone, FrictionCombine, Kind, Group, Pair, Column, Run, Handles, HullTables, FieldTables, Memory, TouchedBodies }
