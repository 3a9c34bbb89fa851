//! A picture of a robot's collision shapes: three-quarter view, side, front and top on one page.
//!
//! The page needs no window, no graphics driver and no font file, and the same robot gives the same bytes. The crate
//! sim-picture draws the shapes (`solids`) of each view; the rest of the page is drawn on a canvas.

mod canvas;
mod file;
mod legend;
mod page;
mod paper;
mod solids;
#[cfg(test)]
mod tests;

use sim_model::Pose;
use sim_model::geometry::TriMesh;

pub(super) use canvas::Canvas;
pub(super) use file::write;

/// What a picture shows.
#[derive(Clone, Debug, Default)]
pub(super) struct Drawing {
    /// Name of the robot.
    pub title: String,
    /// What it is, in a line.
    pub summary: String,
    /// At which joint positions it is drawn.
    pub caption: String,
    /// Names of the links, in body order.
    pub links: Vec<String>,
    /// Frame of each link in the world, in body order, and the place of its parent in that order.
    pub frames: Vec<(Pose, Option<usize>)>,
    /// Shapes of the robot: place of their link in body order, frame in the world, triangles in that frame.
    pub shapes: Vec<(u32, Pose, TriMesh)>,
    /// Shapes around the robot, likewise: they are drawn as far as the views of the robot reach.
    pub surroundings: Vec<(u32, Pose, TriMesh)>,
}

impl Drawing {
    /// Draws it.
    pub fn render(&self) -> Canvas {
        page::render(self)
    }
}
