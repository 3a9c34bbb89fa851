//! Arrays that a caller sets: how states, commands and parameters reach a backend.

use super::Precision;
use super::state::array_of;
use sim_physics::arrays::Array;
use sim_physics::arrays::{Axis, Command, Field, Keeper, Takes};
use sim_physics::constants::Constants;
use sim_physics::constants::params::{Param, Per};
use sim_physics::lane::Real;
use std::ops::Range;

/// An array that a caller sets: part of the state, a command, or a parameter that varies between worlds.
///
/// Commands are the fields that have a [`Command`] in their row and, where the run has them, loads: parameters that act at once and
/// that a reset clears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// A part of the state, or a command.
    Field(Field),
    /// A parameter.
    Param(Param),
}

impl From<Field> for Input {
    fn from(field: Field) -> Input {
        Input::Field(field)
    }
}

impl From<Param> for Input {
    fn from(param: Param) -> Input {
        Input::Param(param)
    }
}

impl Input {
    /// Every command: the fields in the order of their table, then the loads.
    pub fn commands() -> impl Iterator<Item = Input> {
        let loads = Param::ALL.into_iter().filter(|param| param.is_load());
        let fields = Field::commands().map(Input::Field);
        fields.chain(loads.map(Input::Param))
    }

    /// The command of a name.
    pub fn command(name: &str) -> Option<Input> {
        Input::named(name).filter(|input| input.is_command())
    }

    /// The array of a name; it may be an output field.
    pub fn named(name: &str) -> Option<Input> {
        let param = Param::named(name).map(Input::Param);
        param.or_else(|| Field::named(name).map(Input::Field))
    }

    /// Name of the array.
    pub fn name(self) -> &'static str {
        match self {
            Input::Field(field) => field.row().name,
            Input::Param(param) => param.row().name,
        }
    }

    /// How it is kept, if it is a command: it holds until it is set again or the world is reset.
    pub fn kept(self) -> Option<Command> {
        match self {
            Input::Field(field) => field.row().command,
            Input::Param(param) => param.is_load().then_some(Command {
                keeper: Keeper::State,
                takes: Takes::Reals,
                stops: true,
            }),
        }
    }

    /// Whether it is a command.
    pub fn is_command(self) -> bool {
        self.kept().is_some()
    }

    /// What its columns are of, and how many each entry of that axis has.
    pub fn axis(self) -> (Axis, usize) {
        match self {
            Input::Field(field) => match *field.row().shape {
                [axis, Axis::Size(parts)] => (axis, parts),
                [axis] => (axis, 1),
                _ => unreachable!("`{}` is an output", field.row().name),
            },
            Input::Param(param) => match param.row().per {
                Per::Entry(entries) => (Axis::Size(entries), 1),
                Per::Dof => (Axis::Dofs, 1),
                Per::Body(parts) => (Axis::Bodies, parts),
                Per::Shape(parts) => (Axis::Shapes, parts),
                Per::Site(parts) => (Axis::Sites, parts),
                Per::ContactSensor => (Axis::ContactSensors, 1),
                Per::Actuator(parts) => (Axis::Actuators, parts),
                Per::ContactPair(parts) => (Axis::ContactPairs, parts),
            },
        }
    }

    /// The group of the state vector that holds the array, and the columns in it.
    pub(in crate::backend) fn place<R: Real>(
        self,
        m: &Constants<R>,
        columns: Range<usize>,
    ) -> (Array, Range<usize>) {
        match self {
            Input::Field(field) => (array_of(field), columns),
            Input::Param(param) => {
                let first = m.varying.first(param).expect("a parameter that varies");
                (Array::Params, first + columns.start..first + columns.end)
            }
        }
    }
}

/// World-major values from a caller, in either precision.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

impl Values<'_> {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Values::F32(v) => v.len(),
            Values::F64(v) => v.len(),
        }
    }

    /// Whether there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at a place.
    pub fn at(&self, place: usize) -> f64 {
        match self {
            Values::F32(v) => f64::from(v[place]),
            Values::F64(v) => v[place],
        }
    }

    /// The first of a part that is not finite in a precision, counted from the first of all.
    pub fn first_not_finite(&self, part: Range<usize>, precision: Precision) -> Option<usize> {
        let first = part.start;
        let place = match self {
            Values::F32(v) => first_bad(&v[part], |x| x.is_finite()),
            Values::F64(v) => first_bad(&v[part], |x| precision.round(x).is_finite()),
        };
        place.map(|place| first + place)
    }
}

/// The place of the first value that is not good. Blocks are tested without a branch per value.
fn first_bad<T: Copy>(values: &[T], is_good: impl Fn(T) -> bool) -> Option<usize> {
    const BLOCK: usize = 64;
    let is_whole = |block: &[T]| block.iter().fold(true, |all, &x| all & is_good(x));
    let block = values.chunks(BLOCK).position(|block| !is_whole(block))?;
    let from = block * BLOCK;
    let place = values[from..].iter().position(|&x| !is_good(x));
    place.map(|place| from + place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_value_that_is_not_finite_is_found_wherever_it_is() {
        for bad in [0, 63, 64, 65, 127, 128, 199] {
            for first in [0, 1, 64] {
                let mut singles = vec![1.0_f32; 265];
                let mut doubles = vec![1.0_f64; 265];
                (singles[first + bad], doubles[first + bad]) = (f32::NAN, 1e300);
                // one behind it does not matter
                (singles[264], doubles[264]) = (f32::INFINITY, f64::NAN);
                let part = first..first + 200;
                let expected = Some(first + bad);
                let of_singles = Values::F32(&singles);
                assert_eq!(
                    of_singles.first_not_finite(part.clone(), Precision::F32),
                    expected
                );
                let of_doubles = Values::F64(&doubles);
                assert_eq!(
                    of_doubles.first_not_finite(part.clone(), Precision::F32),
                    expected
                );
                assert_eq!(of_doubles.first_not_finite(part, Precision::F64), None);
            }
        }
    }
}
