//! What a caller gives for a command: arrays that are copied once. `tightloop.sim.command_arrays` converts others.

use std::ops::Range;

use numpy::{PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_protocol::{Command, Description, RobotRange, Values};

/// A robot's part of the columns of an input: its name, the first column, the end, and how many are of a floating base.
pub(crate) type Place = (String, usize, usize, usize);

/// The inputs that a scene has, with what their columns are.
pub(crate) struct InputTable {
    worlds: usize,
    rows: Vec<InputRow>,
}

/// An input of a scene.
pub(crate) struct InputRow {
    name: String,
    pub(crate) columns: usize,
    /// The shape of an array of all columns that is taken as it is.
    shape: Vec<usize>,
    /// Columns of each name.
    pub(crate) parts: usize,
    pub(crate) names: Vec<String>,
    /// The parts of the robots, where inputs come by robot or by name, too.
    pub(crate) robots: Option<Vec<Place>>,
}

impl InputTable {
    pub(crate) fn new(description: &Description) -> InputTable {
        let inputs = description.commands.iter().chain(&description.writes);
        let mut rows: Vec<InputRow> = Vec::new();
        for input in inputs {
            if rows.iter().all(|row| row.name != input.name) {
                rows.push(InputRow::new(description, &input.name, input.columns));
            }
        }
        // those that a scene lacks, and that messages about its robots are of
        for known in sim_daemon::command_rows() {
            let row = InputRow::new(description, known.name, 0);
            if !known.is_param
                && row.robots.is_some()
                && rows.iter().all(|row| row.name != known.name)
            {
                rows.push(row);
            }
        }
        InputTable {
            worlds: description.worlds,
            rows,
        }
    }

    /// The input of a name, if the scene has it.
    pub(crate) fn row(&self, name: &str) -> Option<&InputRow> {
        self.rows.iter().find(|row| row.name == name)
    }
}

impl InputRow {
    fn new(description: &Description, name: &str, columns: usize) -> InputRow {
        let (axis, parts) = sim_daemon::input_axis(name).unwrap_or((String::new(), 1));
        let names = description.names(&axis).unwrap_or_default();
        let robots = description.robots.iter();
        let robots: Option<Vec<Place>> = robots
            .map(|robot| {
                let [start, stop] = robot.columns(&axis)?;
                let base = base(&axis, &names[start..stop]);
                Some((robot.name.clone(), start, stop, base))
            })
            .collect();
        let worlds = description.worlds;
        InputRow {
            name: name.to_owned(),
            columns,
            shape: match parts {
                1 => vec![worlds, columns],
                parts => vec![worlds, columns / parts, parts],
            },
            parts,
            names: names.to_vec(),
            robots: robots.filter(|_| RobotRange::has(&axis)),
        }
    }

    /// The columns that a robot's array has, if it has all, or all but those of a floating base.
    fn columns_of(&self, robot: &str, size: usize) -> Option<Range<usize>> {
        let mut robots = self.robots.iter().flatten();
        let (_, start, stop, base) = robots.find(|(name, ..)| name == robot)?;
        let firsts = [*start, start + base];
        let first = firsts.into_iter().find(|first| stop - first == size)?;
        Some(first..*stop)
    }
}

/// How many of a robot's columns are of a floating base, which may be left out.
fn base(axis: &str, names: &[String]) -> usize {
    // a planar base has an x, too
    let (first, last, size) = match axis {
        "dofs" => (".vx", ".wz", 6),
        "coords" => (".x", ".qw", 7),
        _ => return 0,
    };
    let is_free =
        names.len() > size && names[0].ends_with(first) && names[size - 1].ends_with(last);
    if is_free { size } else { 0 }
}

pyo3::create_exception!(
    _core,
    NotReady,
    PyException,
    "The values of these names are converted before the client takes them; nothing was done."
);

/// Values of a command or state that Python has converted: runs of neighbouring columns, each with its first column.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Columns(Vec<(usize, Py<PyArray2<f64>>)>);

#[pymethods]
impl Columns {
    #[new]
    fn new(runs: Vec<(usize, Py<PyArray2<f64>>)>) -> Columns {
        Columns(runs)
    }
}

/// The arrays of one command.
pub(crate) struct Inputs<'a, 'py>(Vec<Input<'a, 'py>>);

struct Input<'a, 'py> {
    field: &'a str,
    columns: Range<usize>,
    array: Array<'py>,
}

enum Array<'py> {
    F32(PyReadonlyArrayDyn<'py, f32>),
    F64(PyReadonlyArrayDyn<'py, f64>),
}

impl<'py> Array<'py> {
    /// The array itself, if it is of floats and contiguous.
    fn from_value(value: &Bound<'py, PyAny>) -> Option<Array<'py>> {
        if let Ok(array) = value.cast::<PyArrayDyn<f32>>() {
            let array = array.is_c_contiguous().then(|| array.try_readonly().ok());
            array?.map(Array::F32)
        } else if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
            let array = array.is_c_contiguous().then(|| array.try_readonly().ok());
            array?.map(Array::F64)
        } else {
            None
        }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Array::F32(array) => array.shape(),
            Array::F64(array) => array.shape(),
        }
    }
}

impl InputTable {
    /// Takes values by name, as arrays that are copied once.
    ///
    /// # Errors
    /// `NotReady` with the names of values that Python converts first.
    pub(crate) fn take<'a, 'py>(&'a self, given: &Bound<'py, PyDict>) -> PyResult<Inputs<'a, 'py>> {
        let mut inputs = Vec::with_capacity(given.len());
        let mut unready = Vec::new();
        for (name, value) in given {
            if value.is_none() {
                continue;
            }
            let name: &str = name.extract()?;
            let is_taken = match self.row(name) {
                Some(row) => self.put(row, &value, &mut inputs)?,
                None => false,
            };
            if !is_taken {
                unready.push(name.to_owned());
            }
        }
        if unready.is_empty() {
            Ok(Inputs(inputs))
        } else {
            Err(NotReady::new_err((unready,)))
        }
    }

    /// Adds the arrays of a value, and returns whether it is taken as it is.
    fn put<'a, 'py>(
        &self,
        row: &'a InputRow,
        value: &Bound<'py, PyAny>,
        inputs: &mut Vec<Input<'a, 'py>>,
    ) -> PyResult<bool> {
        if let Some(array) = Array::from_value(value) {
            let fits = array.shape() == row.shape;
            if fits {
                inputs.push(Input {
                    field: &row.name,
                    columns: 0..row.columns,
                    array,
                });
            }
            return Ok(fits);
        }
        if let Ok(columns) = value.cast::<Columns>() {
            for (first, values) in &columns.get().0 {
                let values = values.bind(value.py()).to_dyn().try_readonly()?;
                inputs.push(Input {
                    field: &row.name,
                    columns: *first..first + values.shape()[1],
                    array: Array::F64(values),
                });
            }
            return Ok(true);
        }
        let parts = self.by_robot(row, value);
        let is_taken = parts.is_some();
        inputs.extend(parts.into_iter().flatten());
        Ok(is_taken)
    }

    /// A dict of arrays by robot, if each can be taken as it is.
    fn by_robot<'a, 'py>(
        &self,
        row: &'a InputRow,
        value: &Bound<'py, PyAny>,
    ) -> Option<Vec<Input<'a, 'py>>> {
        let named = value.cast::<PyDict>().ok()?;
        row.robots.as_ref().filter(|_| row.parts == 1)?;
        let parts = named.iter().map(|(robot, value)| {
            let array = Array::from_value(&value)?;
            let &[worlds, size] = array.shape() else {
                return None;
            };
            let columns = row.columns_of(robot.extract().ok()?, size)?;
            (worlds == self.worlds).then_some(Input {
                field: &row.name,
                columns,
                array,
            })
        });
        parts.collect()
    }
}

impl Inputs<'_, '_> {
    /// The arrays as the protocol takes them.
    pub(crate) fn commands(&self) -> PyResult<Vec<Command<'_>>> {
        let commands = self.0.iter().map(|input| {
            let values = match &input.array {
                Array::F32(array) => Values::F32(array.as_slice()?),
                Array::F64(array) => Values::F64(array.as_slice()?),
            };
            Ok(Command {
                field: input.field,
                columns: input.columns.clone(),
                values,
            })
        });
        commands.collect()
    }
}

/// Which worlds a reset or a write touches; none = all.
pub(crate) type Mask<'py> = Option<PyReadonlyArrayDyn<'py, bool>>;
/// Seeds of a reset: one for all worlds, or one per world.
pub(crate) type Seeds<'py> = Option<PyReadonlyArrayDyn<'py, u64>>;
