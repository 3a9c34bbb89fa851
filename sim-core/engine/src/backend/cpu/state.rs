//! How the numbers of a world lie: state, commands, and parameters that vary.

use sim_core::batch::Field;
use sim_core::lane::Real;
use sim_core::model::constants::Constants;

/// Groups of numbers of a world, in their order.
#[derive(Clone, Copy)]
pub(super) enum StateField {
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
pub(super) struct Shape {
    pub dofs: usize,
    coords: usize,
    /// Numbers of the commands of the frames before.
    pub history: usize,
    params: usize,
}

impl Shape {
    pub(super) fn of<R: Real>(m: &Constants<R>) -> Shape {
        let dofs = m.dofs.len();
        Shape {
            dofs,
            coords: m.coords,
            history: m.delay.frames * 3 * dofs,
            params: m.varying.len(),
        }
    }

    /// The first number of a group.
    pub(super) fn start(self, field: StateField) -> usize {
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

    pub(super) fn total(self) -> usize {
        self.start(StateField::Params) + self.params
    }
}

impl StateField {
    pub(super) fn of(field: Field) -> StateField {
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
