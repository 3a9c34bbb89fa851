//! What the text of physics reads of a model: numbers in the precision of the run.

use crate::lane::Real;
use crate::math::factor::Pattern;

/// A model's constants. Dofs are sorted so that parents precede children.
#[derive(Clone, Debug)]
pub struct Constants<R> {
    /// Duration of one substep [s].
    pub dt: R,
    /// Gravity in world axes [m/s²].
    pub gravity: [R; 3],
    /// Degrees of freedom, each with the body that it moves.
    pub dofs: Vec<Dof<R>>,
    /// Frames of all links, those that move with another included.
    pub frames: Vec<Frame<R>>,
    /// Soft equality of two joints.
    pub equalities: Vec<Equality<R>>,
    /// Dry friction of a joint.
    pub frictions: Vec<Friction<R>>,
    /// Range of a joint.
    pub limits: Vec<Limit<R>>,
    /// Entries of the mass matrix and of the solver's Hessian that may differ from zero.
    pub pattern: Pattern,
    /// Solver options.
    pub solver: Newton<R>,
}

/// A degree of freedom: a joint whose axis is the z axis of its body's frame.
#[derive(Clone, Debug)]
pub struct Dof<R> {
    /// Does it turn about z, or slide along it?
    pub revolute: bool,
    /// The dof that carries this one; none for the base.
    pub parent: Option<usize>,
    /// Frame at q = 0 in the carrier's frame: columns of the rotation [–].
    pub rotation: [[R; 3]; 3],
    /// The same rotation as a quaternion (x, y, z, w) [–].
    pub quat: [R; 4],
    /// Origin of the frame at q = 0 in the carrier's frame [m].
    pub position: [R; 3],
    /// Mass of the body, links fixed to it included [kg].
    pub mass: R,
    /// Centre of mass in the body's frame [m].
    pub center: [R; 3],
    /// xx yy zz xy xz yz about the centre of mass, in the body's axes [kg·m²].
    pub inertia: [R; 6],
    /// Inertia of the drive, added to the diagonal of the mass matrix [kg·m² or kg].
    pub armature: R,
    /// Passive damping [N·m·s/rad or N·s/m].
    pub damping: R,
    /// Proportional gain, 0 in velocity mode [N·m/rad or N/m].
    pub ke: R,
    /// Derivative gain [N·m·s/rad or N·s/m].
    pub kd: R,
    /// Does the drive follow the velocity target?
    pub follows_velocity: bool,
    /// Bound of the drive's force; none = no limit [N·m or N].
    pub effort_limit: Option<R>,
}

/// A link's frame: a constant pose in the frame of the dof that carries it.
#[derive(Clone, Debug)]
pub struct Frame<R> {
    /// The carrying dof; none for what is fixed to the world.
    pub dof: Option<usize>,
    /// Origin in the carrier's frame, or relative to the base [m].
    pub position: [R; 3],
    /// Orientation in the carrier's frame, (x, y, z, w) [–].
    pub quat: [R; 4],
    /// Reference point of the robot: the world position of its base [m].
    pub base: [R; 3],
}

/// Softness of a constraint row whose impedance depends on its position.
#[derive(Clone, Copy, Debug)]
pub struct Soft<R> {
    /// Reference stiffness k of `aref = -b v - k imp pos` [1/s²].
    pub stiffness: R,
    /// Reference damping b [1/s].
    pub damping: R,
    /// Approximate inverse inertia seen by the row [1/(kg·m²) or 1/kg].
    pub inverse_weight: R,
    /// Impedance.
    pub impedance: Impedance<R>,
}

/// MuJoCo's `solimp`: impedance rises from `d_min` at 0 to `d_max` at `width`, along two parabolas that meet at `midpoint`.
#[derive(Clone, Copy, Debug)]
pub struct Impedance<R> {
    /// At the constraint's surface [–].
    pub d_min: R,
    /// At `width` and beyond [–].
    pub d_max: R,
    /// 1 / width, the position at which `d_max` is reached [1/m or 1/rad].
    pub inverse_width: R,
    /// Where the parabolas meet, as a share of the width [–].
    pub midpoint: R,
}

/// `q[follower] = offset + multiplier q[leader]`.
#[derive(Clone, Debug)]
pub struct Equality<R> {
    /// Dof that follows.
    pub follower: usize,
    /// Dof that leads.
    pub leader: usize,
    /// [–]
    pub multiplier: R,
    /// [rad or m]
    pub offset: R,
    /// Softness.
    pub soft: Soft<R>,
}

/// Dry friction: a force of at most `loss` against motion.
#[derive(Clone, Debug)]
pub struct Friction<R> {
    /// Dof that rubs.
    pub dof: usize,
    /// Bound of the force [N·m or N].
    pub loss: R,
    /// Reference damping b of `aref = -b v` [1/s].
    pub damping: R,
    /// Regularised stiffness D = 1/R.
    pub weight: R,
    /// R × loss: beyond it the force is at its bound.
    pub zone: R,
}

/// Range of a joint, soft on both sides.
#[derive(Clone, Debug)]
pub struct Limit<R> {
    /// Dof that is limited.
    pub dof: usize,
    /// [rad or m]
    pub lower: R,
    /// [rad or m]
    pub upper: R,
    /// Softness.
    pub soft: Soft<R>,
}

/// Options of the constraint solver.
#[derive(Clone, Debug)]
pub struct Newton<R> {
    /// Most iterations.
    pub iterations: usize,
    /// Most line-search evaluations an iteration.
    pub ls_iterations: usize,
    /// Improvement of the cost below which the solver stops: the option × mean inertia × dofs.
    pub tolerance: R,
}

impl<R: Real> Constants<R> {
    /// The same numbers, rounded to another precision.
    pub fn cast<S: Real>(&self) -> Constants<S> {
        let soft = |s: &Soft<R>| Soft {
            stiffness: cast(s.stiffness),
            damping: cast(s.damping),
            inverse_weight: cast(s.inverse_weight),
            impedance: Impedance {
                d_min: cast(s.impedance.d_min),
                d_max: cast(s.impedance.d_max),
                inverse_width: cast(s.impedance.inverse_width),
                midpoint: cast(s.impedance.midpoint),
            },
        };
        Constants {
            dt: cast(self.dt),
            gravity: self.gravity.map(cast),
            dofs: self
                .dofs
                .iter()
                .map(|d| Dof {
                    revolute: d.revolute,
                    parent: d.parent,
                    rotation: d.rotation.map(|column| column.map(cast)),
                    quat: d.quat.map(cast),
                    position: d.position.map(cast),
                    mass: cast(d.mass),
                    center: d.center.map(cast),
                    inertia: d.inertia.map(cast),
                    armature: cast(d.armature),
                    damping: cast(d.damping),
                    ke: cast(d.ke),
                    kd: cast(d.kd),
                    follows_velocity: d.follows_velocity,
                    effort_limit: d.effort_limit.map(cast),
                })
                .collect(),
            frames: self
                .frames
                .iter()
                .map(|f| Frame {
                    dof: f.dof,
                    position: f.position.map(cast),
                    quat: f.quat.map(cast),
                    base: f.base.map(cast),
                })
                .collect(),
            equalities: self
                .equalities
                .iter()
                .map(|e| Equality {
                    follower: e.follower,
                    leader: e.leader,
                    multiplier: cast(e.multiplier),
                    offset: cast(e.offset),
                    soft: soft(&e.soft),
                })
                .collect(),
            frictions: self
                .frictions
                .iter()
                .map(|f| Friction {
                    dof: f.dof,
                    loss: cast(f.loss),
                    damping: cast(f.damping),
                    weight: cast(f.weight),
                    zone: cast(f.zone),
                })
                .collect(),
            limits: self
                .limits
                .iter()
                .map(|l| Limit {
                    dof: l.dof,
                    lower: cast(l.lower),
                    upper: cast(l.upper),
                    soft: soft(&l.soft),
                })
                .collect(),
            pattern: self.pattern.clone(),
            solver: Newton {
                iterations: self.solver.iterations,
                ls_iterations: self.solver.ls_iterations,
                tolerance: cast(self.solver.tolerance),
            },
        }
    }

    /// Constraint rows: equalities, then frictions, then limits (MuJoCo's order).
    #[inline(always)]
    pub fn rows(&self) -> usize {
        self.equalities.len() + self.frictions.len() + self.limits.len()
    }
}

fn cast<R: Real, S: Real>(x: R) -> S {
    S::of(x.to_f64())
}
