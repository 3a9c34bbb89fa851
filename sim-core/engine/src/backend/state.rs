//! How the numbers of a world lie: state, commands, and parameters that vary.

use sim_model::Model;
use sim_physics::arrays::Field;
use sim_physics::constants::Constants;
use sim_physics::lane::Real;

/// Groups of numbers of a world, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend) enum StateField {
    Qd,
    Qdd,
    F,
    TargetQ,
    TargetQd,
    Q,
    QRest,
    /// Commands of the frames before, the last one first, each as F, TargetQ, TargetQd.
    History,
    /// Last, so that clients find them in a snapshot.
    Params,
}

/// Numbers of a world's state and commands.
#[derive(Clone, Copy)]
pub(in crate::backend) struct Shape {
    pub dofs: usize,
    coords: usize,
    /// Numbers of the commands of the frames before.
    pub history: usize,
    params: usize,
}

impl Shape {
    pub(in crate::backend) fn of<R: Real>(m: &Constants<R>) -> Shape {
        let dofs = m.dofs.len();
        Shape {
            dofs,
            coords: m.coords,
            history: m.delay.frames * 3 * dofs,
            params: m.varying.len(),
        }
    }

    /// The first number of a group.
    pub(in crate::backend) fn start(self, field: StateField) -> usize {
        let (dofs, coords) = (5 * self.dofs, self.coords);
        match field {
            StateField::Qd => 0,
            StateField::Qdd => self.dofs,
            StateField::F => 2 * self.dofs,
            StateField::TargetQ => 3 * self.dofs,
            StateField::TargetQd => 4 * self.dofs,
            StateField::Q => dofs,
            StateField::QRest => dofs + coords,
            StateField::History => dofs + 2 * coords,
            StateField::Params => dofs + 2 * coords + self.history,
        }
    }

    /// Numbers of a world.
    pub(in crate::backend) fn total(self) -> usize {
        self.start(StateField::Params) + self.params
    }
}

impl StateField {
    pub(in crate::backend) fn of(field: Field) -> StateField {
        match field {
            Field::JointQ => StateField::Q,
            Field::JointQd => StateField::Qd,
            Field::JointF => StateField::F,
            Field::JointTargetQ => StateField::TargetQ,
            Field::JointTargetQd => StateField::TargetQd,
            other => unreachable!("`{}` is not written from outside", other.row().name),
        }
    }
}

/// State and commands of a world after a reset, in the order of [`StateField`].
pub(in crate::backend) fn start<R: Real>(model: &Model) -> Vec<R> {
    let shape = Shape::of(model.constants());
    let start = model.start();
    let mut reset = vec![R::default(); shape.total()];
    for (field, values) in [
        (StateField::Q, &start.joint_q),
        (StateField::TargetQ, &start.joint_target_q),
        (StateField::TargetQd, &start.joint_target_qd),
    ] {
        for (to, from) in reset[shape.start(field)..].iter_mut().zip(values) {
            *to = R::of(*from);
        }
    }
    let (sent, history) = (shape.start(StateField::F), shape.start(StateField::History));
    for k in 0..shape.history {
        reset[history + k] = reset[sent + k % (3 * shape.dofs)];
    }
    for (k, &(_, x)) in model.constants().varying.starts().iter().enumerate() {
        reset[shape.start(StateField::Params) + k] = R::of(x);
    }
    reset
}
