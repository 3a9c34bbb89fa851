//! Commands and loads of a simulation, which hold until they are set again or the world is reset.

use crate::backend::{BackendError, Values};
use crate::simulation::Simulation;
use sim_physics::arrays::{Field, Group};
use sim_physics::constants::params::Param;
use std::ops::Range;

impl Simulation {
    /// Sets columns of a command in all worlds.
    ///
    /// `values` is `(worlds, columns)`, world-major. Where the run freezes worlds whose commands are NaN or infinite
    /// ([`crate::backend::Faults::freezes_nan`]), these keep what they had.
    ///
    /// # Errors
    /// A field that is no command, columns or length that do not fit, a value that is not finite where that is refused;
    /// nothing is written then.
    pub fn command(
        &mut self,
        field: Field,
        columns: Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        self.check(field, Group::Command, &columns, values, None)?;
        let good = self.good_worlds(columns.len(), values);
        let backend = self.backend_mut();
        backend.write(field, columns, values, good.as_deref());
        if let Some(good) = good {
            backend.freeze_others(&good);
        }
        Ok(())
    }

    /// Sets columns of a load in all worlds, as [`Simulation::command`] does those of a command.
    ///
    /// # Errors
    /// As [`Simulation::write_param`].
    pub fn load(
        &mut self,
        param: Param,
        columns: Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        let good = self.good_load(param, &columns, values)?;
        self.write_param(param, columns, values, good.as_deref())?;
        if let Some(good) = good {
            self.backend_mut().freeze_others(&good);
        }
        Ok(())
    }

    /// Checks what [`Simulation::load`] would, without setting anything.
    ///
    /// # Errors
    /// As there.
    pub fn check_load(
        &self,
        param: Param,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<(), BackendError> {
        let good = self.good_load(param, columns, values)?;
        self.check_param(param, columns, values, good.as_deref())
            .map(drop)
    }

    fn good_load(
        &self,
        param: Param,
        columns: &Range<usize>,
        values: Values<'_>,
    ) -> Result<Option<Vec<bool>>, BackendError> {
        let all = param.columns(&self.model().sizes());
        self.check_shape(param.row().name, all, columns, values.len())?;
        Ok(self.good_worlds(columns.len(), values))
    }

    /// The worlds whose values are finite, where the run freezes others and there are some.
    fn good_worlds(&self, columns: usize, values: Values<'_>) -> Option<Vec<bool>> {
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
