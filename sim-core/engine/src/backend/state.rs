//! How the scalars of a world lie in its record: state, commands, and parameters that vary.

use sim_model::Model;
use sim_physics::arrays::{Array, Field, Source, Writer};
use sim_physics::constants::Constants;
use sim_physics::lane::Real;
use sim_physics::step::StageId;

/// The arrays of a record in their order, which is that of a snapshot's file: arrays with an entry for each dof first, the
/// parameters last.
pub(in crate::backend) const RECORD: [Array; 16] = [
    Array::JointQd,
    Array::JointQdd,
    Array::JointF,
    Array::JointTargetQ,
    Array::JointTargetQd,
    Array::JointQ,
    Array::JointQRest,
    Array::Act,
    Array::ControlHistory,
    Array::PlasticRest,
    Array::CommandHistory,
    Array::Ctrl,
    Array::MocapPos,
    Array::MocapQuat,
    Array::EqActive,
    Array::Params,
];

/// Is it what a step changes, and not a command?
pub(in crate::backend) fn is_motion(array: &Array) -> bool {
    array.writer() == Writer::Motion
}

/// Lengths of the arrays of a world's record.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Shape {
    pub dofs: usize,
    /// First scalar of each array of [`RECORD`], then the end of the last.
    starts: [usize; RECORD.len() + 1],
}

impl Shape {
    pub(in crate::backend) fn from_constants<R: Real>(m: &Constants<R>) -> Shape {
        let mut starts = [0; RECORD.len() + 1];
        for (k, array) in RECORD.into_iter().enumerate() {
            starts[k + 1] = starts[k] + array.scalars(m);
        }
        Shape {
            dofs: m.dofs.len(),
            starts,
        }
    }

    /// The first scalar of an array.
    pub(in crate::backend) fn start(&self, array: Array) -> usize {
        self.starts[place(array)]
    }

    /// Scalars of an array.
    pub(in crate::backend) fn len(&self, array: Array) -> usize {
        self.starts[place(array) + 1] - self.start(array)
    }

    /// Scalars of a world.
    pub(in crate::backend) fn total(&self) -> usize {
        self.starts[RECORD.len()]
    }
}

fn place(array: Array) -> usize {
    let index = RECORD.iter().position(|known| *known == array);
    index.unwrap_or_else(|| unreachable!("{array:?} is not of a record"))
}

/// Do these stages look for contacts, and count those that do not fit?
pub(in crate::backend) fn finds_contacts(stages: &[StageId]) -> bool {
    stages
        .iter()
        .any(|stage| stage.row().writes.contains(&Array::LeftOut))
}

/// The array that a field of a state or a command is.
pub(in crate::backend) fn array_of(field: Field) -> Array {
    match field.row().source {
        Source::Array(array) => array,
        _ => unreachable!("`{}` is not written from outside", field.row().name),
    }
}

/// State and commands of a world after a reset, in the order of [`RECORD`].
pub(in crate::backend) fn start<R: Real>(model: &Model) -> Vec<R> {
    let shape = Shape::from_constants(model.constants());
    let start = model.start();
    let mut reset = vec![R::default(); shape.total()];
    let plastic_rests = model.constants().springs.starting_rests();
    for (array, values) in [
        (Array::JointQ, &start.joint_q),
        (Array::PlasticRest, &plastic_rests),
        (Array::JointTargetQ, &start.joint_target_q),
        (Array::JointTargetQd, &start.joint_target_qd),
        (Array::MocapPos, &start.mocap_pos),
        (Array::MocapQuat, &start.mocap_quat),
        (Array::EqActive, &start.eq_active),
    ] {
        for (to, from) in reset[shape.start(array)..].iter_mut().zip(values) {
            *to = R::from_f64(*from);
        }
    }
    let (sent, history) = (
        shape.start(Array::JointF),
        shape.start(Array::CommandHistory),
    );
    for k in 0..shape.len(Array::CommandHistory) {
        reset[history + k] = reset[sent + k % (3 * shape.dofs)];
    }
    for (k, &(_, x)) in model.constants().varying.starts().iter().enumerate() {
        reset[shape.start(Array::Params) + k] = R::from_f64(x);
    }
    reset
}
