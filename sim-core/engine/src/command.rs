//! Commands of a simulation: those of [`Input::commands`] that the run has.
//!
//! [`Simulation::command`] checks the array, writes the worlds whose values are finite, and freezes
//! the others where the run is set to freeze them. A command holds until it is set again or the world is reset.
//!
//! Those that drives keep act with the world's command delay and carry noise; the others act at once.

use crate::backend::{BackendError, Input, Values};
use crate::simulation::Simulation;
use sim_physics::arrays::{Field, Group};
use std::ops::Range;

impl Simulation {
    /// Sets columns of a command in all worlds.
    ///
    /// `values` is `(worlds, columns)`, world-major. Where the run freezes worlds whose commands are NaN or infinite
    /// ([`crate::backend::Faults::freezes_nan`]), these worlds keep their earlier command.
    ///
    /// # Errors
    /// An array that is no command, or that does not vary in this run; wrong columns or length; a value that is not finite, where
    /// the run refuses those. Nothing is written then.
    pub fn command(
        &mut self,
        input: impl Into<Input>,
        columns: Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        let input = input.into();
        let finite = self.accept(input, &columns, values)?;
        let backend = self.backend_mut();
        backend.write(input, columns, values, finite.as_deref());
        if let Some(finite) = finite {
            backend.freeze_others(&finite);
        }
        Ok(())
    }

    /// Checks as [`Simulation::command`] does, without setting anything: so that of several arrays none is set when one is wrong.
    ///
    /// # Errors
    /// As [`Simulation::command`].
    pub fn check_command(
        &self,
        input: impl Into<Input>,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        self.accept(input.into(), columns, values).map(drop)
    }

    /// Checks a command. Returns the worlds to write: none = all.
    fn accept(
        &self,
        input: Input,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<Option<Vec<bool>>, BackendError> {
        match input {
            Input::Param(param) if param.is_load() => {
                let all = param.columns(&self.model().sizes());
                self.check_shape(param.row().name, all, columns, values.len())?;
                let finite = self.finite_worlds(columns.len(), values);
                self.check_param(param, columns, values, finite.as_deref())?;
                Ok(finite)
            }
            Input::Param(param) => Err(BackendError::Group {
                field: param.row().name,
                expected: "a command",
                choices: command_names(),
            }),
            Input::Field(field) => {
                self.check_field(field, Group::Command, columns, values, None)?;
                Ok(self.finite_worlds(columns.len(), values))
            }
        }
    }

    /// The worlds whose values are all finite; none if all are, or if the run refuses values that are not finite.
    fn finite_worlds(&self, columns: usize, values: Values<'_>) -> Option<Vec<bool>> {
        let first_bad = |part| values.first_not_finite(part, self.precision());
        if !self.freezes_nan() || first_bad(0..values.len()).is_none() {
            return None;
        }
        let row = |world: usize| world * columns..(world + 1) * columns;
        let worlds = 0..self.worlds();
        Some(
            worlds
                .map(|world| first_bad(row(world)).is_none())
                .collect(),
        )
    }
}

fn command_names() -> String {
    let names: Vec<_> = Field::commands().map(|field| field.row().name).collect();
    names.join(", ")
}
