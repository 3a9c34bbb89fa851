//! What a caller gives for a command: arrays for the whole scene or by robot, made ready to be copied once.

use std::ops::Range;

use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyMapping};
use sim_protocol::{Command, Description, RobotRange, Values};

use crate::errors::raise;

/// What the columns of an input are.
#[derive(Clone, Copy)]
pub(crate) enum Axis {
    Dofs,
    Coords,
    Actuators,
}

impl Axis {
    /// The columns of a robot.
    fn of(self, robot: &RobotRange) -> Range<usize> {
        let [start, stop] = match self {
            Axis::Dofs => robot.dofs,
            Axis::Coords => robot.coords,
            Axis::Actuators => robot.actuators,
        };
        start..stop
    }

    /// Names of all columns.
    fn names(self, description: &Description) -> &[String] {
        match self {
            Axis::Dofs => &description.dof_names,
            Axis::Coords => &description.coord_names,
            Axis::Actuators => &description.actuator_names,
        }
    }
}

/// The arrays of one command.
pub(crate) struct Inputs<'a, 'py> {
    description: &'a Description,
    arrays: Vec<Input<'a, 'py>>,
}

struct Input<'a, 'py> {
    field: &'a str,
    columns: Range<usize>,
    array: Array<'py>,
}

enum Array<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
}

impl Input<'_, '_> {
    fn command(&self) -> PyResult<Command<'_>> {
        let values = match &self.array {
            Array::F32(array) => Values::F32(array.as_slice()?),
            Array::F64(array) => Values::F64(array.as_slice()?),
        };
        Ok(Command {
            field: self.field,
            columns: self.columns.clone(),
            values,
        })
    }
}

impl<'a, 'py> Inputs<'a, 'py> {
    pub(crate) fn new(description: &'a Description) -> Inputs<'a, 'py> {
        Inputs {
            description,
            arrays: Vec::with_capacity(3),
        }
    }

    /// Takes a parameter, a part of the state or a command of every world that needs no conversion: all columns, or a list
    /// of runs of them, first column and array.
    pub(crate) fn add_ready(&mut self, name: &str, value: &Bound<'py, PyAny>) -> PyResult<()> {
        let params = self.description.params.iter().map(|param| &param.info);
        let known = params
            .chain(&self.description.writes)
            .chain(&self.description.commands)
            .find(|info| info.name == name);
        let refused = |reason: String| raise(value.py(), "CommandRefused", reason);
        let info = known.ok_or_else(|| refused(format!("this scene has no `{name}`")))?;
        if let Ok(runs) = value.cast::<PyList>() {
            return self.add_runs(&info.name, runs.as_any());
        }
        let array = value.cast::<PyArrayDyn<f64>>()?;
        if !array.is_c_contiguous() {
            return Err(refused(format!("{name}: its rows are not contiguous")));
        }
        self.arrays.push(Input {
            field: &info.name,
            columns: 0..info.columns,
            array: Array::F64(array.try_readonly()?),
        });
        Ok(())
    }

    /// Takes runs of columns: the first column of each, and its array, contiguous in float64.
    fn add_runs(&mut self, field: &'a str, runs: &Bound<'py, PyAny>) -> PyResult<()> {
        for run in runs.try_iter()? {
            let (first, array): (usize, Bound<'py, PyAny>) = run?.extract()?;
            let array = array.cast_into::<PyArrayDyn<f64>>()?.try_readonly()?;
            self.arrays.push(Input {
                field,
                columns: first..first + array.shape()[1],
                array: Array::F64(array),
            });
        }
        Ok(())
    }

    /// Takes an argument: nothing, an array for the whole scene, or a mapping of arrays by robot or name.
    pub(crate) fn add(
        &mut self,
        field: &'static str,
        axis: Axis,
        value: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<()> {
        let Some(value) = value else { return Ok(()) };
        let columns = 0..axis.names(self.description).len();
        if let Some(array) = self.ready(value, &columns) {
            self.arrays.push(Input {
                field,
                columns,
                array,
            });
        } else if let Ok(named) = value.cast::<PyDict>() {
            self.add_parts(field, axis, value, named.iter().collect())?;
        } else if let Ok(named) = value.cast::<PyMapping>() {
            let items = named.items()?;
            let items = items.iter().map(|item| item.extract());
            self.add_parts(field, axis, value, items.collect::<PyResult<_>>()?)?;
        } else {
            self.convert((field, axis), None, columns, value)?;
        }
        Ok(())
    }

    /// Takes a mapping: arrays by robot, or, where names of joints are among them, by these.
    fn add_parts(
        &mut self,
        field: &'static str,
        axis: Axis,
        given: &Bound<'py, PyAny>,
        items: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    ) -> PyResult<()> {
        let robots = &self.description.robots;
        let is_robot = |(name, value): &(Bound<'py, PyAny>, Bound<'py, PyAny>)| {
            let name = name.extract::<&str>().ok();
            name.is_some_and(|name| robots.iter().any(|robot| robot.name == name))
                && value.cast::<PyMapping>().is_err()
        };
        if !items.iter().all(is_robot) {
            return self.add_named(field, axis, given);
        }
        for (name, value) in items {
            self.add_robot(field, axis, &name, &value)?;
        }
        Ok(())
    }

    /// Takes single columns by name or pattern, beside whole robots; the others keep what they had.
    fn add_named(
        &mut self,
        field: &'static str,
        axis: Axis,
        given: &Bound<'py, PyAny>,
    ) -> PyResult<()> {
        let robots = self.description.robots.iter();
        let robots: Vec<(&str, usize, usize, usize)> = robots
            .map(|robot| {
                let columns = axis.of(robot);
                let base = self.base(axis, &columns);
                (robot.name.as_str(), columns.start, columns.end, base)
            })
            .collect();
        let followers = self.description.followers.iter();
        let followers: Vec<(&str, &str, f64, f64)> = followers
            .map(|own| {
                let names = (own.name.as_str(), own.leader.as_str());
                (names.0, names.1, own.multiplier, own.offset)
            })
            .collect();
        let more = PyDict::new(given.py());
        more.set_item("followers", followers)?;
        let (names, worlds) = (axis.names(self.description), self.description.worlds);
        let parts = given
            .py()
            .import("tightloop.arrays.named_columns")?
            .getattr("named_columns")?
            .call((field, given, worlds, names, robots), Some(&more))?;
        self.add_runs(field, &parts)
    }

    fn add_robot(
        &mut self,
        field: &'static str,
        axis: Axis,
        name: &Bound<'py, PyAny>,
        value: &Bound<'py, PyAny>,
    ) -> PyResult<()> {
        let mut robots = self.description.robots.iter();
        let name: &str = name.extract()?;
        let Some(robot) = robots.find(|robot| robot.name == name) else {
            return Ok(()); // `add_parts` found it
        };
        let Range { start, end: stop } = axis.of(robot);
        let base = self.base(axis, &(start..stop));
        for columns in [start..stop, start + base..stop] {
            if let Some(array) = self.ready(value, &columns) {
                self.arrays.push(Input {
                    field,
                    columns,
                    array,
                });
                return Ok(());
            }
        }
        self.convert((field, axis), Some(&robot.name), start..stop, value)
    }

    /// How many of a robot's columns are of a floating base, which may be left out.
    fn base(&self, axis: Axis, columns: &Range<usize>) -> usize {
        // a planar base has an x, too
        let (names, first, last, size) = match axis {
            Axis::Dofs => (&self.description.dof_names, ".vx", ".wz", 6),
            Axis::Coords => (&self.description.coord_names, ".x", ".qw", 7),
            Axis::Actuators => return 0,
        };
        let is_free = columns.len() > size
            && names[columns.start].ends_with(first)
            && names[columns.start + size - 1].ends_with(last);
        if is_free { size } else { 0 }
    }

    /// The array itself, when it needs no conversion.
    fn ready(&self, value: &Bound<'py, PyAny>, columns: &Range<usize>) -> Option<Array<'py>> {
        let shape = [self.description.worlds, columns.len()];
        if let Ok(array) = value.cast::<PyArrayDyn<f32>>() {
            (array.shape() == shape && array.is_c_contiguous())
                .then(|| array.try_readonly().ok().map(Array::F32))?
        } else if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
            (array.shape() == shape && array.is_c_contiguous())
                .then(|| array.try_readonly().ok().map(Array::F64))?
        } else {
            None
        }
    }

    /// The slow way, for everything else that NumPy can make an array of; or an error that says why not.
    fn convert(
        &mut self,
        (field, axis): (&'static str, Axis),
        robot: Option<&str>,
        columns: Range<usize>,
        value: &Bound<'py, PyAny>,
    ) -> PyResult<()> {
        let base = robot.map_or(0, |_| self.base(axis, &columns));
        let robots = self.description.robots.iter();
        let sizes: Vec<(&str, usize, usize)> = robots
            .map(|robot| {
                let columns = axis.of(robot);
                (
                    robot.name.as_str(),
                    columns.len(),
                    self.base(axis, &columns),
                )
            })
            .collect();
        let arguments = (field, robot, value, self.description.worlds, columns.len());
        let more = PyDict::new(value.py());
        more.set_item("base", base)?;
        more.set_item("robots", sizes)?;
        let array = value
            .py()
            .import("tightloop.arrays.inputs")?
            .getattr("as_array")?
            .call(arguments, Some(&more))?;
        let array = array.cast_into::<PyArrayDyn<f64>>()?.try_readonly()?;
        let size = array.shape()[1];
        self.arrays.push(Input {
            field,
            columns: columns.end - size..columns.end,
            array: Array::F64(array),
        });
        Ok(())
    }

    /// The arrays as the protocol takes them.
    pub(crate) fn commands(&self) -> PyResult<Vec<Command<'_>>> {
        self.arrays.iter().map(Input::command).collect()
    }
}

/// Which worlds a reset or a write touches.
pub(crate) struct Mask<'py>(Option<PyReadonlyArrayDyn<'py, bool>>);

impl<'py> Mask<'py> {
    /// `name` is the argument's, for messages.
    pub(crate) fn new(
        name: &str,
        mask: Option<&Bound<'py, PyAny>>,
        worlds: usize,
    ) -> PyResult<Mask<'py>> {
        let Some(mask) = mask else {
            return Ok(Mask(None));
        };
        let checked = mask
            .py()
            .import("tightloop.arrays.inputs")?
            .getattr("as_mask")?
            .call1((name, mask, worlds))?;
        Ok(Mask(Some(
            checked.cast_into::<PyArrayDyn<bool>>()?.try_readonly()?,
        )))
    }

    pub(crate) fn as_slice(&self) -> PyResult<Option<&[bool]>> {
        Ok(self.0.as_ref().map(|mask| mask.as_slice()).transpose()?)
    }
}

/// Seeds of a reset: one for all worlds, or one per world.
pub(crate) struct Seed<'py>(Option<PyReadonlyArrayDyn<'py, u64>>);

impl<'py> Seed<'py> {
    pub(crate) fn new(seed: Option<&Bound<'py, PyAny>>, worlds: usize) -> PyResult<Seed<'py>> {
        let Some(seed) = seed else {
            return Ok(Seed(None));
        };
        let checked = seed
            .py()
            .import("tightloop.arrays.inputs")?
            .getattr("as_seed")?
            .call1((seed, worlds))?;
        Ok(Seed(Some(
            checked.cast_into::<PyArrayDyn<u64>>()?.try_readonly()?,
        )))
    }

    pub(crate) fn as_slice(&self) -> PyResult<Option<&[u64]>> {
        Ok(self.0.as_ref().map(|seed| seed.as_slice()).transpose()?)
    }
}
