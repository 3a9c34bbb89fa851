//! Writes of states and parameters.

use crate::backend::{BackendError, Input, Values};
use crate::simulation::Simulation;
use sim_physics::arrays::Group;
use std::ops::Range;

impl Simulation {
    /// Sets columns of a state, of a command of a model from MuJoCo, or of a parameter in the worlds of the mask (none = all). A written state clears the warm start.
    ///
    /// `values` is `(worlds, columns)`, world-major. Rows of other worlds are ignored. Quaternions are normalized. Parameters
    /// count from the next step on.
    ///
    /// # Errors
    /// A field that is no state; a parameter that does not vary; wrong columns, length or mask; a value that is not finite or below
    /// the parameter's least; a quaternion without direction. Nothing is written then.
    pub fn write(
        &mut self,
        input: impl Into<Input>,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        let input = input.into();
        self.check_write(input, &columns, values, mask)?;
        self.backend_mut().write(input, columns, values, mask);
        Ok(())
    }

    /// Checks as [`Simulation::write`] does, without setting anything.
    ///
    /// # Errors
    /// As [`Simulation::write`].
    pub fn check_write(
        &self,
        input: impl Into<Input>,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        match input.into() {
            Input::Field(field) => {
                let group = match field.is_written() {
                    true => field.row().group,
                    false => Group::State,
                };
                self.check_field(field, group, columns, values, mask)
            }
            Input::Param(param) => self.check_param(param, columns, values, mask),
        }
    }
}
