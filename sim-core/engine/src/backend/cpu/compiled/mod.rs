//! Stages of a substep as machine code, where the model can be compiled: all of them without contacts, else those before contacts
//! are found, and the integrator.
//!
//! The code has the bits of the stages.

mod check;
mod listing;
mod section;
mod stack;
mod suits;

pub(super) use check::StagesOfModel;
pub use listing::{ProgramListing, SectionListing, listing};
use section::RecordedSection;
pub(super) use section::Section;
use sim_compile::{Size, Target};
use sim_model::Model;
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use sim_physics::schedule::step_stages;
use sim_physics::step::StageId;
use stack::with_stack;
use std::ops::Range;
use suits::{runs, suits};

/// What of a substep is machine code.
pub(super) struct CompiledStep {
    sections: Vec<Section>,
    /// By place of a stage in a substep: the section that begins there.
    beginning: Vec<Option<usize>>,
    /// See [`check::sizes_of_arrays`].
    sizes_of_arrays: Vec<usize>,
}

/// Why a model has no machine code that should have it, for people.
pub(super) type Refusal = String;

impl CompiledStep {
    /// What of the model's substep is compiled for registers of `F`; none where the stages run: in double precision, for one world
    /// in a block, and for a kind of processor without a compiler.
    ///
    /// # Errors
    /// A recorded operation that the compiler does not know, or a system that forbids machine code.
    pub fn of_model<F: Lane>(model: &Model) -> Result<Option<CompiledStep>, Refusal> {
        let target = match F::Real::DOUBLE {
            true => None,
            false => Target::of_width(F::WIDTH),
        };
        let Some(target) = target.filter(|_| suits(model.constants())) else {
            return Ok(None);
        };
        let m = model.constants().cast();
        let made = each_section(&m, |recorded| recorded.compiled(&m.contacts.tables, target))?;
        let mut step = CompiledStep {
            sections: Vec::new(),
            beginning: vec![None; step_stages(&m).len()],
            sizes_of_arrays: check::sizes_of_arrays(&m),
        };
        for (run, section) in made {
            step.beginning[run.start] = Some(step.sections.len());
            step.sections.push(section);
        }
        Ok(Some(step))
    }

    /// Is all of the substep machine code?
    pub fn is_whole(&self) -> bool {
        matches!(&self.sections[..], [section] if section.stages() == self.beginning.len())
    }

    /// How many sections it has.
    pub fn sections(&self) -> usize {
        self.sections.len()
    }

    /// The section that begins with the stage at this place of a substep, and its number.
    #[inline(always)]
    pub fn section_at(&self, place: usize) -> Option<(usize, &Section)> {
        let number = self.beginning[place]?;
        Some((number, &self.sections[number]))
    }

    /// Memory that a section needs, in registers.
    pub fn scratch(&self) -> usize {
        self.sections
            .iter()
            .map(Section::scratch)
            .max()
            .unwrap_or(0)
    }

    /// Where the stages are in memory: address, bytes and name of each piece.
    pub fn pieces(&self) -> impl Iterator<Item = (usize, usize, &'static str)> {
        self.sections.iter().flat_map(Section::pieces)
    }

    /// Sizes of the programs of all sections: of those that assume, and of the others.
    pub fn sizes(&self) -> [Size; 2] {
        let add = |all: Size, more: Size| Size {
            bytes: all.bytes + more.bytes,
            instructions: all.instructions + more.instructions,
            spills: all.spills + more.spills,
            slots: all.slots.max(more.slots),
        };
        let sizes = self.sections.iter().map(Section::sizes);
        let all = sizes.reduce(|all, more| [add(all[0], more[0]), add(all[1], more[1])]);
        all.expect("a step has a section")
    }
}

/// Records every section of a model and makes something of it, with the places of its stages in a substep.
fn each_section<T: Send>(
    m: &Constants<f32>,
    make: impl Fn(RecordedSection) -> Result<T, Refusal> + Sync,
) -> Result<Vec<(Range<usize>, T)>, Refusal> {
    let substep = step_stages(m);
    let made = |run: Range<usize>| {
        // a block pauses at the end of a run of stages, never in it
        let pauses = |stage: &StageId| !stage.resumes().is_empty();
        let has_contacts = !m.contacts.classes.is_empty();
        assert!(!(has_contacts && substep[run.clone()].iter().any(pauses)));
        let recorded = RecordedSection::new(m, &substep, run.clone())?;
        Ok((run, make(recorded)?))
    };
    with_stack(|| runs(m, &substep).into_iter().map(made).collect())
}
