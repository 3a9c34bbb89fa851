//! Checks of a scene: its steps, its solver, and all that it holds.

use super::robot::few_dofs;
use super::shape::{pose, shape_sizes};
use crate::description::{Description, Robot};
use crate::error::ModelError;
use crate::value_checks::{count, finite, in_range, name, not_negative, positive, unique, within};

/// Largest ratio of frictional and normal impedance [–].
const IMPRATIO_MAX: f64 = 1e5;
/// Longest physics step [s]: longer ones are a slip of units.
const DT_MAX: f64 = 1.0;
/// Most physics steps in a control frame.
const SUBSTEPS_MAX: usize = 10_000;
/// Most iterations of the solver or its line search.
const ITERATIONS_MAX: usize = 10_000;
/// Most dofs of all robots of a scene: its dense inverse at the reference pose takes a second.
const SCENE_DOFS_MAX: usize = 2048;
/// Most contacts that a world has room for: of a heap of a thousand boxes.
const CONTACTS_MAX: usize = 4096;
/// Most rows of contacts: four for each, which is a pyramid's.
const ROWS_MAX: usize = 4 * CONTACTS_MAX;

/// Most shapes of a scene besides those of robot files, as many as one robot file may have.
const SHAPES_MAX: usize = 10_000;

/// Refuses a scene of more dofs or shapes than a model can have, before anything of it is built.
///
/// # Errors
/// [`ModelError::TooManyDofs`], or [`ModelError::OutOfRange`] for the shapes.
pub fn check_counts(dofs: usize, shapes: usize) -> Result<(), ModelError> {
    few_dofs("the scene".to_owned(), dofs, SCENE_DOFS_MAX)?;
    let rule =
        "at most 10000 are supported; make a terrain one mesh or height field, or split the scene";
    let most = SHAPES_MAX as f64;
    within("the scene's number of shapes", shapes as f64, most, rule)
}

impl Description {
    /// Checks everything that `compile` relies on.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        let (dt, substeps) = (self.dt, self.substeps);
        in_range(
            "dt",
            dt,
            0.0 < dt && dt <= DT_MAX,
            "it must be above 0 and at most 1 s, such as 1/480",
        )?;
        count(
            "substeps",
            substeps,
            SUBSTEPS_MAX,
            "it must be between 1 and 10000",
        )?;
        for (axis, &value) in ["x", "y", "z"].iter().zip(&self.gravity) {
            finite(&format!("gravity {axis}"), value)?;
        }
        let solver = &self.solver;
        count(
            "solver iterations",
            solver.iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        count(
            "solver ls_iterations",
            solver.ls_iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        not_negative("solver tolerance", solver.tolerance)?;
        positive("solver impratio", solver.impratio)?;
        let rule = "give at most 1e5: beyond, single precision has no digits left for the bodies";
        within("solver impratio", solver.impratio, IMPRATIO_MAX, rule)?;

        let dofs = self.robots.iter().map(Robot::dof_count).sum();
        check_counts(dofs, self.shapes.len())?;
        let robots = self.robots.iter().map(|robot| robot.name.as_str());
        unique("scene", "robot", robots).map_err(|(_, error)| error)?;
        let shapes = self.shapes.iter().map(|shape| shape.name.as_str());
        unique("scene", "shape", shapes).map_err(|(_, error)| error)?;
        for shape in &self.shapes {
            name("shape", &shape.name)?;
            let what = format!("shape `{}`", shape.name);
            pose(&what, &shape.pose)?;
            shape_sizes(&what, &shape.shape)?;
            shape.surface.validate(&what)?;
        }
        if let Some(contacts) = self.contacts_max {
            let rule = "it must be between 1 and 4096";
            count("contacts_max", contacts, CONTACTS_MAX, rule)?;
        }
        if let Some(rows) = self.rows_max {
            count("rows_max", rows, ROWS_MAX, "it must be between 1 and 16384")?;
        }
        self.robots.iter().try_for_each(Robot::validate)?;
        self.validate_shape_names()?;
        self.validate_sensors()?;
        self.validate_cameras()?;
        self.param_draws().map(drop)
    }
}
