//! Parameters of a simulation: written and read per world, effective from the next step on.

use crate::backend::{BackendError, Input, Values};
use crate::simulation::Simulation;
use sim_physics::constants::params::{Param, Per};
use std::ops::Range;

/// A value may be below the least of its parameter by the rounding to `f32` [–].
const ROUNDING: f64 = 1e-7;

impl Simulation {
    /// Sets columns of a parameter in the worlds of the mask (none = all), from the next step on.
    ///
    /// # Errors
    /// As [`Simulation::write`].
    pub fn write_param(
        &mut self,
        param: Param,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        self.write(param, columns, values, mask)
    }

    /// A parameter of every world, `(worlds, columns)`, world-major.
    ///
    /// # Errors
    /// [`BackendError::Constant`].
    pub fn param(&self, param: Param) -> Result<Vec<f64>, BackendError> {
        let first = self.first_of(param)?;
        let columns = param.columns(&self.model().sizes());
        let mut numbers = vec![0.0; self.worlds() * columns];
        self.backend().params(first..first + columns, &mut numbers);
        Ok(numbers)
    }

    /// Checks an array of a parameter.
    pub(crate) fn check_param(
        &self,
        param: Param,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        self.first_of(param)?;
        self.check_mask(mask)?;
        self.check_shape(
            param.row().name,
            param.columns(&self.model().sizes()),
            columns,
            values.len(),
        )?;
        let least = param
            .row()
            .least
            .map_or(f64::NEG_INFINITY, |least| least * (1.0 - ROUNDING));
        for world in (0..self.worlds()).filter(|&world| mask.is_none_or(|mask| mask[world])) {
            for column in columns.clone() {
                let value = values.at(world * columns.len() + column - columns.start);
                let rounded = self.precision().round(value);
                let name = || self.param_name(param, column);
                if !rounded.is_finite() {
                    return Err(BackendError::NotFinite {
                        field: param.row().name,
                        world,
                        name: name(),
                        value: rounded,
                    });
                }
                if value < least {
                    return Err(BackendError::BelowLeast {
                        param: param.row().name,
                        world,
                        name: name(),
                        value,
                        least: param.row().least.unwrap_or_default(),
                    });
                }
                let most = self.model().command_delay_max();
                if param == Param::CommandDelay && value > most as f64 {
                    return Err(BackendError::Delay { world, value, most });
                }
                if param == Param::JointTargetKe
                    && value > 0.0
                    && !self.model().constants().dofs[column].follows_position
                {
                    return Err(BackendError::VelocityMode {
                        name: name(),
                        value,
                    });
                }
            }
        }
        Ok(())
    }

    fn first_of(&self, param: Param) -> Result<usize, BackendError> {
        let varying = &self.model().constants().varying;
        varying.first(param).ok_or_else(|| {
            let names: Vec<_> = varying.params().map(|param| param.row().name).collect();
            BackendError::Constant {
                param: param.row().name,
                varying: match names.len() {
                    0 => "none does".to_owned(),
                    _ => names.join(", "),
                },
            }
        })
    }

    /// Name of the joint, body, shape or axis that a column belongs to.
    fn param_name(&self, param: Param, column: usize) -> String {
        if param.row().per == Per::Entry(1) {
            return "all its commands".to_owned();
        }
        let (axis, parts) = Input::from(param).axis();
        self.model().names(axis).swap_remove(column / parts)
    }
}
