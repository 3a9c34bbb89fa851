//! Checks of arrays that callers give: shape, finite values, quaternions, targets, masks.

use crate::backend::{BackendError, Input, Values};
use crate::simulation::Simulation;
use sim_physics::arrays::{Field, Group, Takes};
use sim_physics::constants::Motion;
use std::ops::Range;

/// Length of the shortest quaternion that defines a rotation [–].
const QUATERNION_MIN: f64 = 1e-6;

impl Simulation {
    /// Checks an array of a field that must belong to `group`. Rows of worlds outside the mask are ignored.
    pub(crate) fn check_field(
        &self,
        field: Field,
        group: Group,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        self.check_mask(mask)?;
        let row = field.row();
        if row.group != group {
            let choices = Field::ALL
                .iter()
                .map(|field| field.row())
                .filter(|row| row.group == group);
            return Err(BackendError::Group {
                field: row.name,
                expected: if group == Group::State {
                    "part of the state"
                } else {
                    "a command"
                },
                choices: choices.map(|row| row.name).collect::<Vec<_>>().join(", "),
            });
        }
        let all = field.elements(&self.model().sizes());
        self.check_shape(row.name, all, columns, values.len())?;
        let row_of = |world: usize| world * columns.len()..(world + 1) * columns.len();
        let not_finite = match mask {
            None => values.first_not_finite(0..values.len(), self.precision()),
            Some(mask) => (0..self.worlds())
                .filter(|&world| mask[world])
                .find_map(|world| values.first_not_finite(row_of(world), self.precision())),
        };
        let is_kept_out = self.freezes_nan() && group == Group::Command;
        if let Some(place) = not_finite.filter(|_| !is_kept_out) {
            let (axis, parts) = Input::from(field).axis();
            let column = columns.start + place % columns.len();
            return Err(BackendError::NotFinite {
                field: row.name,
                world: place / columns.len(),
                name: self.model().names(axis).swap_remove(column / parts),
                value: self.precision().round(values.at(place)),
            });
        }
        match row.command.map(|command| command.takes) {
            Some(Takes::Targets) => self.check_targets(field, columns, values),
            Some(Takes::Switches) => self.check_switches(field, columns, values, mask),
            Some(Takes::Reals) => Ok(()),
            None if field == Field::JointQ => self.check_quaternions(columns, values, mask),
            None => Ok(()),
        }
    }

    /// Refuses columns outside of `all`, and a wrong number of values.
    pub(crate) fn check_shape(
        &self,
        field: &'static str,
        all: usize,
        columns: &Range<usize>,
        got: usize,
    ) -> Result<(), BackendError> {
        if columns.start > columns.end || columns.end > all {
            return Err(BackendError::Columns {
                field,
                columns: all,
                start: columns.start,
                end: columns.end,
            });
        }
        let expected = self.worlds() * columns.len();
        if got != expected {
            return Err(BackendError::Length {
                field,
                got,
                expected,
                worlds: self.worlds(),
                columns: columns.len(),
            });
        }
        Ok(())
    }

    /// Refuses targets of a free body: it has no drive, and a value must not be dropped silently.
    fn check_targets(
        &self,
        field: Field,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        let bodies = &self.model().constants().bodies;
        let free = bodies.iter().filter(|body| body.motion == Motion::Free);
        for dof in free
            .flat_map(|body| body.dofs())
            .filter(|dof| columns.contains(dof))
        {
            for world in 0..self.worlds() {
                let place = world * columns.len() + dof - columns.start;
                let value = values.at(place);
                if value.abs() > 0.0 {
                    return Err(BackendError::FreeTarget {
                        field: field.row().name,
                        world,
                        name: self.model().dof_names()[dof].clone(),
                        value,
                    });
                }
            }
        }
        Ok(())
    }

    /// Refuses values that are neither 0 nor 1.
    fn check_switches(
        &self,
        field: Field,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        for world in (0..self.worlds()).filter(|&world| mask.is_none_or(|mask| mask[world])) {
            for column in columns.clone() {
                let value = values.at(world * columns.len() + column - columns.start);
                if value != 0.0 && value != 1.0 {
                    return Err(BackendError::Switch {
                        field: field.row().name,
                        world,
                        name: {
                            let (axis, parts) = Input::from(field).axis();
                            self.model().names(axis).swap_remove(column / parts)
                        },
                        value,
                    });
                }
            }
        }
        Ok(())
    }

    /// Refuses quaternions without direction. The backend normalizes the others.
    fn check_quaternions(
        &self,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        for first in self.model().constants().quaternions() {
            if first + 4 <= columns.start || columns.end <= first {
                continue;
            }
            let name = || self.model().coord_names()[first].clone();
            if first < columns.start || columns.end < first + 4 {
                return Err(BackendError::PartOfQuaternion { name: name() });
            }
            for world in (0..self.worlds()).filter(|&world| mask.is_none_or(|mask| mask[world])) {
                let place = world * columns.len() + first - columns.start;
                let square: f64 = (place..place + 4).map(|i| values.at(i).powi(2)).sum();
                if !square.is_finite() || square < QUATERNION_MIN * QUATERNION_MIN {
                    return Err(BackendError::Quaternion {
                        name: name(),
                        world,
                    });
                }
            }
        }
        Ok(())
    }

    /// Checks the length of a mask.
    ///
    /// # Errors
    /// A mask of the wrong length.
    pub fn check_mask(&self, mask: Option<&[bool]>) -> Result<(), BackendError> {
        match mask {
            Some(mask) if mask.len() != self.worlds() => Err(BackendError::Mask {
                got: mask.len(),
                worlds: self.worlds(),
            }),
            _ => Ok(()),
        }
    }
}
