//! Checks of a robot: its name, its links, and that its parts fit together.

use super::fault::{Culprit, Fault};
use super::shape::{collision_name, length, pose, shape_sizes};
use crate::description::{Joint, Link, Robot};
use crate::error::ModelError;
use crate::geometry::Shape;
use crate::inertia::{negative_moment, triangle_excess};
use crate::value_checks::{name, not_negative, unique, within};

/// Most dofs of one robot: a chain of them compiles in ten seconds.
const ROBOT_DOFS_MAX: usize = 1024;
/// Largest mass [kg]: ten of the largest ships.
const MASS_MAX: f64 = 1e10;
/// Largest entry of an inertia [kg·m²]: a kilometre of them.
const INERTIA_MAX: f64 = 1e16;

impl Robot {
    /// Checks one robot on its own.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        self.find_fault().map_err(|fault| *fault.error)
    }

    /// The first thing that is wrong, and where.
    pub(crate) fn find_fault(&self) -> Result<(), Fault> {
        self.validate_whole()
            .map_err(|error| Culprit::Robot.blame(error))?;
        let owner = format!("robot `{}`", self.name);
        let links = self.links.iter().map(|link| link.name.as_str());
        unique(&owner, "link", links).map_err(|(i, error)| Culprit::Link(i).blame(error))?;
        let joints = self.joints.iter().map(|joint| joint.name.as_str());
        unique(&owner, "joint", joints).map_err(|(i, error)| Culprit::Joint(i).blame(error))?;
        for (i, link) in self.links.iter().enumerate() {
            self.validate_link(&owner, link)
                .map_err(|error| Culprit::Link(i).blame(error))?;
        }
        self.validate_tree()?;
        for (i, joint) in self.joints.iter().enumerate() {
            self.validate_joint(&owner, joint)
                .map_err(|error| Culprit::Joint(i).blame(error))?;
        }
        self.validate_free()?;
        self.validate_moving_mass()?;
        // joints `a.x` and the x of a planar joint `a` would be one
        let dofs = self.dof_names();
        unique(&owner, "dof", dofs.iter().map(String::as_str))
            .map_err(|(_, error)| Culprit::Robot.blame(error))
    }

    /// Name, place and number of dofs.
    fn validate_whole(&self) -> Result<(), ModelError> {
        name("robot", &self.name)?;
        if self.name.contains('/') {
            let rule = "a slash separates robot and joint in `robot/joint`; leave it out";
            return Err(ModelError::BadName {
                what: "robot",
                name: self.name.clone(),
                rule,
            });
        }
        let owner = format!("robot `{}`", self.name);
        pose(&owner, &self.pose)?;
        few_dofs(owner, self.dof_count(), ROBOT_DOFS_MAX)
    }

    pub(super) fn dof_count(&self) -> usize {
        let dofs = |joint: &Joint| joint.kind.dof_names().len();
        self.joints.iter().map(dofs).sum()
    }

    fn validate_link(&self, owner: &str, link: &Link) -> Result<(), ModelError> {
        name("link", &link.name)?;
        let what = format!("{owner}: link `{}`", link.name);
        if let Some(inertial) = &link.inertial {
            let mass = format!("{what}: mass");
            not_negative(&mass, inertial.mass)?;
            within(&mass, inertial.mass, MASS_MAX, "give at most 1e10 kg")?;
            length(&format!("{what}: centre of mass"), inertial.pos)?;
            for value in inertial.inertia.into_iter().flatten() {
                let rule = "give at most 1e16 kg·m²";
                within(&format!("{what}: inertia"), value, INERTIA_MAX, rule)?;
            }
            let (robot, link) = (self.name.clone(), link.name.clone());
            if let Some(moment) = negative_moment(inertial.inertia) {
                return Err(ModelError::NegativeInertia {
                    robot,
                    link,
                    moment,
                });
            }
            if let Some(ratio) = triangle_excess(inertial.inertia) {
                return Err(ModelError::InertiaTriangle { robot, link, ratio });
            }
        }
        for (index, collision) in link.collisions.iter().enumerate() {
            let what = collision_name(&what, index, collision);
            pose(&what, &collision.pose)?;
            shape_sizes(&what, &collision.shape)?;
            collision.surface.validate(&what)?;
            // geoms of the world are shapes of link 0
            let is_static = matches!(collision.shape, Shape::Plane | Shape::HeightField(_));
            if is_static && self.precompiled.is_none() {
                return Err(ModelError::PlaneBorne { what });
            }
        }
        Ok(())
    }
}

/// Refuses more dofs than a model can have.
pub(super) fn few_dofs(owner: String, dofs: usize, most: usize) -> Result<(), ModelError> {
    if dofs > most {
        return Err(ModelError::TooManyDofs { owner, dofs, most });
    }
    Ok(())
}
