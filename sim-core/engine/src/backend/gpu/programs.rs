//! Programs of a model: its stages recorded, as few kernels as a driver compiles in good time.

use super::places::Places;
use crate::backend::gather::gather;
use sim_core::batch::{Field, WorkSlot as Slot};
use sim_core::lane::Num;
use sim_core::model::constants::Constants;
use sim_core::step::{STAGES, Stage};
use sim_core::times;
use sim_record::wgsl::{ProgramOptions, wgsl};
use sim_record::{RecordError, Recorded, Recording};
use stages_recorded::{between, run};

/// Statements of a kernel, beyond which stages are not joined: a driver's time grows faster than they do.
const STATEMENTS_MAX: usize = 5000;
/// What outlasts a substep.
const KEPT: [Slot; 7] = [
    Slot::JointQ,
    Slot::JointQRest,
    Slot::JointQd,
    Slot::JointQdd,
    Slot::Unconverged,
    Slot::LeftOut,
    Slot::Substep,
];

/// The text of a kernel.
pub(super) struct Kernel {
    /// The stages in it, for people.
    pub label: String,
    pub wgsl: String,
}

/// What a frame dispatches.
pub(super) struct Programs {
    /// Kernels of a step, in order.
    pub step: Vec<Kernel>,
    /// How often they are dispatched in a frame.
    pub rounds: usize,
    /// Kernels that evaluate what is shown.
    pub evaluate: Vec<Kernel>,
}

impl Programs {
    /// Records the programs of a model: `shown` evaluates, `fields` are what it is for.
    ///
    /// # Errors
    /// A text that cannot be recorded, which tests of the recorder rule out.
    pub fn new(
        m: &Constants<f32>,
        places: &Places,
        substeps: usize,
        shown: &[Stage],
        fields: &[(Field, usize)],
        wanted: &[Slot],
    ) -> Result<Programs, RecordError> {
        let needed: Vec<Stage> = (STAGES.into_iter()).filter(|s| s.is_needed(m)).collect();
        let groups = groups(m, &needed)?;
        let (step, rounds) = match &groups[..] {
            // without the searches of hulls, which are loops as deep as a text may have them
            [all] if m.contacts.groups.is_empty() => (vec![frame(m, places, all, substeps)?], 1),
            _ => (kernels(m, places, &groups, &KEPT, false)?, substeps),
        };
        let shown: Vec<Stage> = (shown.iter().copied()).filter(|s| s.is_needed(m)).collect();
        let computed = fields.iter().flat_map(|(field, _)| reads_of(*field));
        let wanted: Vec<Slot> = wanted.iter().chain(computed).copied().collect();
        let mut evaluate = kernels(m, places, &self::groups(m, &shown)?, &wanted, true)?;
        for &(field, numbers) in fields {
            evaluate.push(computed_field(m, places, field, numbers)?);
        }
        Ok(Programs {
            step,
            rounds,
            evaluate,
        })
    }
}

/// Neighbouring stages that make a kernel.
fn groups(m: &Constants<f32>, stages: &[Stage]) -> Result<Vec<Vec<Stage>>, RecordError> {
    let mut groups: Vec<Vec<Stage>> = Vec::new();
    let mut total = usize::MAX / 2;
    for &stage in stages {
        let alone = recorded(m, &[stage], stage.reads(), stage.writes())?;
        let statements = alone.statements().total();
        total += statements;
        match groups.last_mut() {
            Some(group) if total <= STATEMENTS_MAX => group.push(stage),
            _ => {
                groups.push(vec![stage]);
                total = statements;
            }
        }
    }
    Ok(groups)
}

/// What a run of stages reads from before it, and what it writes.
fn effects(stages: &[Stage]) -> (Vec<Slot>, Vec<Slot>) {
    let (mut reads, mut writes) = (Vec::new(), Vec::new());
    for stage in stages {
        for slot in stage.reads() {
            if !writes.contains(slot) && !reads.contains(slot) {
                reads.push(*slot);
            }
        }
        for slot in stage.writes() {
            if !writes.contains(slot) {
                writes.push(*slot);
            }
        }
    }
    (reads, writes)
}

fn recorded(
    m: &Constants<f32>,
    stages: &[Stage],
    reads: &[Slot],
    writes: &[Slot],
) -> Result<Recording, RecordError> {
    between(m, reads, writes, |cx, b| {
        stages.iter().for_each(|stage| run(*stage, cx, m, b));
        Vec::new()
    })
}

/// A kernel for each group; of what it writes it stores what later groups read, and what outlasts them all.
fn kernels(
    m: &Constants<f32>,
    places: &Places,
    groups: &[Vec<Stage>],
    outlasts: &[Slot],
    is_shown: bool,
) -> Result<Vec<Kernel>, RecordError> {
    let mut kernels = Vec::new();
    let mut moved = false;
    for (k, group) in groups.iter().enumerate() {
        let (reads, writes) = effects(group);
        let later: Vec<Slot> = (groups[k + 1..].iter())
            .flat_map(|group| effects(group).0)
            .collect();
        let writes: Vec<Slot> = (writes.into_iter())
            .filter(|slot| {
                later.contains(slot) || outlasts.contains(slot) || *slot == Slot::LeftOut
            })
            .collect();
        let recording = recorded(m, group, &reads, &writes)?;
        // what is shown leaves the solver's next start as it is
        let place = |slot: &Slot, moved: bool| match slot {
            Slot::JointQdd if is_shown && moved => {
                let first = places.shown_qdd;
                first..first + m.dofs.len() as u32
            }
            _ => places.of(*slot),
        };
        let inputs = reads.iter().flat_map(|slot| place(slot, moved)).collect();
        moved |= writes.contains(&Slot::JointQdd);
        let outputs = writes.iter().flat_map(|slot| place(slot, moved)).collect();
        kernels.push(printed(label(group), &recording, inputs, outputs));
    }
    Ok(kernels)
}

/// All substeps in one kernel.
fn frame(
    m: &Constants<f32>,
    places: &Places,
    stages: &[Stage],
    substeps: usize,
) -> Result<Kernel, RecordError> {
    let (mut reads, _) = effects(stages);
    // what a substep leaves to the next is read by the frame
    for slot in KEPT {
        if !reads.contains(&slot) {
            reads.push(slot);
        }
    }
    let recording = between(m, &reads, &KEPT, |cx, b| {
        times!(cx, substeps, {
            for stage in stages {
                run(*stage, cx, m, b);
            }
        });
        Vec::new()
    })?;
    let inputs = reads.iter().flat_map(|slot| places.of(*slot)).collect();
    let outputs = KEPT.iter().flat_map(|slot| places.of(*slot)).collect();
    Ok(printed("frame".to_owned(), &recording, inputs, outputs))
}

/// What a field that is computed for output is made of.
fn reads_of(field: Field) -> &'static [Slot] {
    match field {
        Field::BodyJacobian => &[Slot::Motion, Slot::LinkCenter],
        Field::EfcJ => &[Slot::EfcWeight, Slot::LimitSide],
        _ => unreachable!("`{}` is not computed", field.row().name),
    }
}

fn computed_field(
    m: &Constants<f32>,
    places: &Places,
    field: Field,
    numbers: usize,
) -> Result<Kernel, RecordError> {
    let reads = reads_of(field);
    let recording = between(m, reads, &[], |cx, b| {
        let mut row = vec![Recorded::c(0.0); numbers];
        gather(cx, m, b, field, &mut row);
        row
    })?;
    let inputs = reads.iter().flat_map(|slot| places.of(*slot)).collect();
    let first = places.computed(field);
    let outputs = (first..first + numbers as u32).collect();
    Ok(printed(
        field.row().name.to_owned(),
        &recording,
        inputs,
        outputs,
    ))
}

fn label(stages: &[Stage]) -> String {
    match stages {
        [one] => one.name().to_owned(),
        [first, .., last] => format!("{} to {}", first.name(), last.name()),
        [] => String::new(),
    }
}

fn printed(label: String, recording: &Recording, inputs: Vec<u32>, outputs: Vec<u32>) -> Kernel {
    let options = ProgramOptions {
        inputs: Some(inputs),
        outputs: Some(outputs),
        ..ProgramOptions::default()
    };
    let wgsl = wgsl(recording, &options);
    Kernel { label, wgsl }
}
