//! Machine code of a model for people.

use super::suits::suits;
use super::{Target, each_section};
use sim_compile::Line;
use sim_model::Model;
use sim_physics::schedule::step_stages;
use std::ops::Range;

/// Stages of a substep that are one program.
pub struct SectionListing {
    /// The stages.
    pub stages: Vec<&'static str>,
    /// The programs: that which assumes that nothing rare happens, where something rare can, then that which assumes nothing.
    pub programs: Vec<ProgramListing>,
}

/// A program.
pub struct ProgramListing {
    /// Does it assume that no joint is at a limit?
    pub assumes: bool,
    /// Its instructions, by what they come from.
    pub lines: Vec<Line>,
}

/// What of the model's substep is compiled for blocks of so many worlds; empty where the stages run.
///
/// # Errors
/// A recorded operation that the compiler does not know.
pub fn listing(model: &Model, worlds: usize) -> Result<Vec<SectionListing>, String> {
    let target = Target::of_width(worlds).filter(|_| suits(model.constants()));
    let Some(target) = target else {
        return Ok(Vec::new());
    };
    let m = model.constants().cast();
    let substep = step_stages(&m);
    let listed = each_section(&m, |recorded| recorded.listed(&m.contacts.tables, target))?;
    let section = |(run, programs): (Range<usize>, _)| SectionListing {
        stages: substep[run].iter().map(|stage| stage.name()).collect(),
        programs,
    };
    Ok(listed.into_iter().map(section).collect())
}
