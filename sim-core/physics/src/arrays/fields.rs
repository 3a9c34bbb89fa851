//! THE table of fields: what can be written, stepped and read, with name, shape and unit.

use crate::constants::Sizes;

/// Element type of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dtype {
    /// 32-bit float.
    F32,
    /// 64-bit float.
    F64,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 32-bit integer.
    U32,
    /// Unsigned 64-bit integer.
    U64,
    /// Byte.
    U8,
}

impl Dtype {
    /// Size of an element [bytes].
    pub const fn bytes(self) -> usize {
        match self {
            Dtype::U8 => 1,
            Dtype::F32 | Dtype::I32 | Dtype::U32 => 4,
            Dtype::F64 | Dtype::U64 => 8,
        }
    }
}

/// Element type of a field: fixed, or the precision of the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldDtype {
    /// f32 or f64, as the run is.
    Real,
    /// Fixed.
    Fixed(Dtype),
}

/// Who may write a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// What resumes a world; `write` sets it.
    State,
    /// Held over a control frame; `step` sets it.
    Command,
    /// Evaluated at the state of the frame.
    Derived,
    /// Kept by the simulation itself; part of every frame.
    Counter,
}

/// A dimension after `worlds`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Degrees of freedom.
    Dofs,
    /// Position coordinates.
    Coords,
    /// Links.
    Bodies,
    /// Constraint rows.
    Rows,
    /// Contacts that a world has room for.
    Contacts,
    /// Sites.
    Sites,
    /// Contact sensors.
    ContactSensors,
    /// A fixed number.
    Size(usize),
}

impl Axis {
    /// Its length for a model.
    pub fn len(self, sizes: &Sizes) -> usize {
        match self {
            Axis::Dofs => sizes.dofs,
            Axis::Coords => sizes.coords,
            Axis::Bodies => sizes.bodies,
            Axis::Rows => sizes.rows,
            Axis::Contacts => sizes.contacts,
            Axis::Sites => sizes.sites,
            Axis::ContactSensors => sizes.contact_sensors,
            Axis::Size(n) => n,
        }
    }

    /// Its name in documents.
    pub fn name(self) -> String {
        match self {
            Axis::Dofs => "dofs".into(),
            Axis::Coords => "coords".into(),
            Axis::Bodies => "bodies".into(),
            Axis::Rows => "rows".into(),
            Axis::Contacts => "contacts".into(),
            Axis::Sites => "sites".into(),
            Axis::ContactSensors => "contact_sensors".into(),
            Axis::Size(n) => n.to_string(),
        }
    }
}

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct FieldRow {
    /// The field.
    pub field: Field,
    /// Its name for clients.
    pub name: &'static str,
    /// Who may write it.
    pub group: Group,
    /// Dimensions after `worlds`.
    pub shape: &'static [Axis],
    /// Unit; `–` for none.
    pub unit: &'static str,
    /// Element type.
    pub dtype: FieldDtype,
    /// What it is.
    pub doc: &'static str,
}

macro_rules! fields {
    ($($field:ident $name:literal $group:ident [$($axis:expr),*] $unit:literal $dtype:expr, $doc:literal;)*) => {
        /// A field of every world.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Field {
            $(#[doc = $doc] $field,)*
        }

        impl Field {
            /// All rows, in order.
            pub const ALL: &'static [Field] = &[$(Field::$field),*];

            /// Its row of the table.
            pub fn row(self) -> &'static FieldRow {
                use Axis::*;
                match self {
                    $(Field::$field => {
                        const ROW: FieldRow = FieldRow {
                            field: Field::$field,
                            name: $name,
                            group: Group::$group,
                            shape: &[$($axis),*],
                            unit: $unit,
                            dtype: $dtype,
                            doc: $doc,
                        };
                        &ROW
                    })*
                }
            }
        }
    };
}

const REAL: FieldDtype = FieldDtype::Real;
const F64: FieldDtype = FieldDtype::Fixed(Dtype::F64);
const U64: FieldDtype = FieldDtype::Fixed(Dtype::U64);
const U32: FieldDtype = FieldDtype::Fixed(Dtype::U32);
const I32: FieldDtype = FieldDtype::Fixed(Dtype::I32);

fields! {
    JointQ "joint_q" State [Coords] "rad or m" REAL, "Joint positions.";
    JointQd "joint_qd" State [Dofs] "rad/s or m/s" REAL, "Joint velocities.";
    JointQdd "joint_qdd" Derived [Dofs] "rad/s² or m/s²" REAL, "Joint accelerations under the commands held, constraints included.";
    JointF "joint_f" Command [Dofs] "N·m or N" REAL, "Joint torques applied, not clamped by the effort limit.";
    JointTargetQ "joint_target_q" Command [Dofs] "rad or m" REAL, "Position targets of the drives.";
    JointTargetQd "joint_target_qd" Command [Dofs] "rad/s or m/s" REAL, "Velocity targets of the drives.";
    BodyQ "body_q" Derived [Bodies, Size(7)] "m, –" REAL, "Link frames in the world: position, then quaternion (x, y, z, w).";
    BodyQd "body_qd" Derived [Bodies, Size(6)] "m/s, rad/s" REAL, "Velocity of each link's centre of mass, then its angular velocity, in world axes.";
    BodyJacobian "body_jacobian" Derived [Bodies, Size(6), Dofs] "m/s or rad/s per rad/s or m/s" REAL, "What takes joint_qd to body_qd.";
    MassMatrix "mass_matrix" Derived [Dofs, Dofs] "kg·m², kg·m or kg" REAL, "Joint-space inertia, armature included.";
    BiasForce "bias_force" Derived [Dofs] "N·m or N" REAL, "Coriolis, centrifugal and gravity forces: what holds the joints at zero acceleration.";
    SmoothForce "smooth_force" Derived [Dofs] "N·m or N" REAL, "Applied, drive and damping forces less the bias: all but constraint forces.";
    ConstraintForce "constraint_force" Derived [Dofs] "N·m or N" REAL, "Constraint forces in joint space, Jᵀ f.";
    EfcJ "efc_J" Derived [Rows, Dofs] "–" REAL, "Constraint Jacobian: equalities, frictions, limits; zero in a row that is not active.";
    EfcD "efc_D" Derived [Rows] "kg·m² or kg" REAL, "Regularised stiffness of a constraint row, 1/R; zero in a row that is not active.";
    EfcAref "efc_aref" Derived [Rows] "rad/s² or m/s²" REAL, "Reference acceleration of a constraint row.";
    EfcForce "efc_force" Derived [Rows] "N·m or N" REAL, "Force of a constraint row.";
    ContactCount "contact_count" Derived [] "–" I32, "Contacts of the world: how many rows of the other contact fields are in use.";
    ContactPos "contact_pos" Derived [Contacts, Size(3)] "m" REAL, "Point half-way between the two surfaces, in the world.";
    ContactNormal "contact_normal" Derived [Contacts, Size(3)] "–" REAL, "Unit normal from the first shape of the pair to the second.";
    ContactDistance "contact_distance" Derived [Contacts] "m" REAL, "Distance of the two surfaces, negative in penetration.";
    ContactForce "contact_force" Derived [Contacts, Size(3)] "N" REAL, "Force on the second shape of the pair, in world axes.";
    ContactPair "contact_pair" Derived [Contacts, Size(2)] "–" I32, "The two shapes, as places in shape_names; -1 in a row that is not in use.";
    BodyContactForce "body_contact_force" Derived [Bodies, Size(3)] "N" REAL, "Sum of the contact forces on each link, in world axes.";
    JointQMeasured "joint_q_measured" Derived [Coords] "rad or m" REAL, "Joint positions with the noise that joint_q_noise gives.";
    JointQdMeasured "joint_qd_measured" Derived [Dofs] "rad/s or m/s" REAL, "Joint velocities with the noise that joint_qd_noise gives.";
    JointTorque "joint_torque" Derived [Dofs] "N·m or N" REAL, "What joint_f and the drive, clamped by its effort limit, give; damping, friction and contacts are not in it.";
    SiteQ "site_q" Derived [Sites, Size(7)] "m, –" REAL, "Sites: position, then quaternion (x, y, z, w), in the world, or in the frame that a site is relative to.";
    SiteQd "site_qd" Derived [Sites, Size(6)] "m/s, rad/s" REAL, "Velocity of each site, then its angular velocity, in world axes, or as seen from and in the axes of the frame that it is relative to.";
    Gyro "gyro" Derived [Sites, Size(3)] "rad/s" REAL, "Angular velocity of each site, in its own axes.";
    Accelerometer "accelerometer" Derived [Sites, Size(3)] "m/s²" REAL, "Acceleration of each site less gravity, in its own axes: 9.81 upwards at rest.";
    SiteInverseJacobian "site_inverse_jacobian" Derived [Sites, Dofs, Size(6)] "rad or m per m or rad" REAL, "What takes a small displacement of each site, of its origin, then of its rotation as a rotation vector, in the axes of site_qd, to one of the joints, as joint_qd has them: Jᵀ (J Jᵀ + λ² I)⁻¹, where J takes joint_qd to site_qd and λ is the site's damping. Zero for dofs that do not move the site.";
    ContactSensor "contact_sensor" Derived [ContactSensors, Size(3)] "N" REAL, "Sum of the contact forces that each contact sensor is about, in world axes.";
    Time "time" Counter [] "s" F64, "Simulated time since the world's reset.";
    Step "step" Counter [] "–" U64, "Control frames since the world's reset.";
    Status "status" Counter [] "–" U32, "Trouble of the world, as bits: 1 = it was no longer finite, or a command of it where the run freezes for that, 8 = it was beyond the bounds of the run: it is frozen at its state before that frame, and `step`, until it is reset; 2 = the solver used up its iterations, 4 = contacts were left out; 0 = none.";
    ContactsLeftOut "contacts_left_out" Counter [] "–" U32, "Contacts that did not fit into contacts_max or rows_max: the most of any substep of the last frame, and of the state shown where contact fields are asked for.";
}

impl Field {
    /// The field of this name.
    pub fn named(name: &str) -> Option<Field> {
        Field::ALL
            .iter()
            .copied()
            .find(|field| field.row().name == name)
    }

    /// Elements per world.
    pub fn elements(self, sizes: &Sizes) -> usize {
        self.row()
            .shape
            .iter()
            .map(|axis| axis.len(sizes))
            .product()
    }
}
