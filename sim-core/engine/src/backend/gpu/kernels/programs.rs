//! Records the physics code of a step and of an evaluation, and partitions it into kernels that a driver compiles in good time.

use super::places::Places;
use super::rolled::LONGEST;
use crate::backend::BackendError;
use crate::backend::gather::gather;
use sim_physics::arrays::{Array, Field, Source};
use sim_physics::constants::Constants;
use sim_physics::lane::Num;
use sim_physics::schedule::step_stages;
use sim_physics::step::StageId;
use sim_physics::times;
use sim_record::split::{Kernel, Limits, Part, Split, split};
use sim_record::wgsl::{Corrections, Exchange, ProgramOptions};
use sim_record::{RecordError, Recorded, Recorder, Recording};
use stages_recorded::{between, effects, kept, run};

/// How kernels are made.
#[derive(Clone, Copy)]
pub(in crate::backend::gpu) struct How {
    pub limits: Limits,
    /// Threads that share a world where contacts can be.
    pub lanes: usize,
    pub exchange: Exchange,
    /// What the driver rounds otherwise than the CPU, where worlds have the CPU's bits.
    pub corrections: Option<Corrections>,
}

impl How {
    /// Sets options of a recording, before physics code runs.
    fn prepare(self, cx: &mut Recorder) {
        if self.corrections.is_some() {
            cx.update_factors();
        }
    }
}

/// A kernel of physics.
pub(in crate::backend::gpu) struct KernelSource {
    pub wgsl: String,
    /// Threads per world.
    pub lanes: u32,
    /// Threads of its workgroups, where that is no choice.
    pub workgroup: Option<u32>,
}

/// Kernels, and the order in which they are dispatched.
pub(in crate::backend::gpu) struct KernelSequence {
    pub kernels: Vec<KernelSource>,
    pub order: Vec<Part>,
}

/// What a frame dispatches.
pub(in crate::backend::gpu) struct Programs {
    /// All substeps.
    pub step: KernelSequence,
    /// The evaluation of output fields.
    pub evaluate: KernelSequence,
    /// Values per world, behind the places, for what crosses from kernel to kernel.
    pub spare: u32,
}

impl Programs {
    /// Records the programs of a model. The stages `shown` evaluate the slots `wanted` and the fields that are computed. Kernels stay
    /// within the limits, where the code allows it.
    ///
    /// # Errors
    /// Physics code that cannot be recorded; tests of the recorder rule that out. A kernel of more than [`LONGEST`].
    pub fn new(
        m: &Constants<f32>,
        places: &Places,
        substeps: usize,
        shown: &[StageId],
        computed: &[(Field, usize)],
        wanted: &[Array],
        how: How,
    ) -> Result<Programs, BackendError> {
        // where nothing touches there are no rows to share
        let lanes = match m.contacts.groups.is_empty() {
            true => 1,
            false => how.lanes,
        };
        // searches on hulls nest loops as deep as a recording may: a loop over substeps does not fit around them
        let (inside, outside) = match m.contacts.groups.is_empty() {
            true => (substeps, 1),
            false => (1, substeps),
        };
        let (recording, options) =
            step(m, places, &step_stages(m), inside, lanes, how).map_err(refused)?;
        let (step, step_spare) = partition(&recording, &options, how, places.len, outside)?;
        let (recording, options) =
            evaluation(m, places, shown, computed, wanted, how).map_err(refused)?;
        let (evaluate, evaluate_spare) = partition(&recording, &options, how, places.len, 1)?;
        Ok(Programs {
            step,
            evaluate,
            spare: step_spare.max(evaluate_spare),
        })
    }
}

fn refused(error: RecordError) -> BackendError {
    BackendError::Program {
        reason: error.to_string(),
    }
}

/// Kernels of a recording that runs so many times.
fn partition(
    recording: &Recording,
    options: &ProgramOptions,
    how: How,
    spare: u32,
    times: usize,
) -> Result<(KernelSequence, u32), BackendError> {
    let options = ProgramOptions {
        exchange: how.exchange,
        corrections: how.corrections.unwrap_or_default(),
        ..options.clone()
    };
    let split = split(recording, &options, how.limits, spare);
    let is_hardware = how.limits.repeated == usize::MAX;
    let costs = split.kernels.iter().map(|k| k.cost(&how.limits.prices));
    let longest = costs.max().unwrap_or(0);
    if is_hardware && longest > LONGEST {
        return Err(BackendError::Program {
            reason: format!(
                "a kernel has {longest} instructions, and a driver takes minutes to compile more than {LONGEST}: \
                 bodies may touch in too many ways"
            ),
        });
    }
    let source = |kernel: &Kernel| {
        let lanes = kernel.recording().lanes() as u32;
        let is_world = lanes > 1 && how.exchange == Exchange::Workgroup;
        KernelSource {
            wgsl: kernel.wgsl(),
            lanes,
            workgroup: is_world.then_some(lanes),
        }
    };
    let mut kernels: Vec<KernelSource> = split.kernels.iter().map(source).collect();
    let joined = match times {
        1 => None,
        _ => joined(&split, how.limits),
    };
    let order = match joined {
        None if times == 1 => split.order,
        None => vec![repeated(times, split.order)],
        Some(wgsl) => {
            let joined = Part::Kernel(kernels.len());
            kernels.push(KernelSource {
                wgsl,
                lanes: 1,
                workgroup: None,
            });
            with_joined(split.order, joined, times)
        }
    };
    Ok((KernelSequence { kernels, order }, split.spare as u32))
}

fn repeated(iterations: usize, parts: Vec<Part>) -> Part {
    Part::Repeat {
        iterations,
        parts,
        exited: None,
    }
}

/// The last kernel and the first one, which follows it in the next repetition, as one program: a dispatch less. None where several
/// threads share a world of either, where they would be too large together, or where there are no two.
fn joined(split: &Split, limits: Limits) -> Option<String> {
    let (Part::Kernel(first), Part::Kernel(last)) = (split.order.first()?, split.order.last()?)
    else {
        return None;
    };
    let [first, last] = [first, last].map(|k| &split.kernels[*k]);
    let lanes = [first, last].map(|kernel| kernel.recording().lanes());
    let cost = first.cost(&limits.prices) + last.cost(&limits.prices);
    let suits = split.order.len() > 1 && lanes == [1, 1] && cost <= limits.kernel;
    suits.then(|| last.wgsl_before(first))
}

/// A b c, three times, with c and a joined: a b (ca) b (ca) b c.
fn with_joined(order: Vec<Part>, joined: Part, times: usize) -> Vec<Part> {
    let [first, middle @ .., last] = &order[..] else {
        unreachable!("two kernels are joined");
    };
    let again = std::iter::once(joined).chain(middle.iter().cloned());
    let mut parts = vec![first.clone()];
    parts.extend_from_slice(middle);
    parts.push(repeated(times - 1, again.collect()));
    parts.push(last.clone());
    parts
}

/// Substeps, one after another.
fn step(
    m: &Constants<f32>,
    places: &Places,
    stages: &[StageId],
    substeps: usize,
    lanes: usize,
    how: How,
) -> Result<(Recording, ProgramOptions), RecordError> {
    let (mut reads, _) = effects(stages);
    let kept = kept();
    // what a substep leaves to the next is read by all of them together
    for array in &kept {
        if !reads.contains(array) {
            reads.push(*array);
        }
    }
    let recording = between(m, &reads, &kept, |cx, b| {
        cx.set_lanes(lanes);
        how.prepare(cx);
        if substeps == 1 {
            stages.iter().for_each(|stage| run(*stage, cx, m, b));
        } else {
            times!(cx, substeps, {
                for stage in stages {
                    run(*stage, cx, m, b);
                }
            });
        }
        Vec::new()
    })?;
    let inputs = reads
        .iter()
        .flat_map(|array| places.range(*array))
        .collect();
    let outputs = kept.iter().flat_map(|array| places.range(*array)).collect();
    Ok((recording, options(inputs, outputs)))
}

/// What is shown: the slots that are wanted and are written, and fields that are made of them.
fn evaluation(
    m: &Constants<f32>,
    places: &Places,
    stages: &[StageId],
    computed: &[(Field, usize)],
    wanted: &[Array],
    how: How,
) -> Result<(Recording, ProgramOptions), RecordError> {
    let (mut reads, written) = effects(stages);
    // fields that are made of the state may read what no stage does
    for &(field, _) in computed {
        if let Source::Computed(arrays) = field.row().source {
            let is_missing = |array: &&Array| !reads.contains(array) && !written.contains(array);
            let missing: Vec<Array> = arrays.iter().filter(is_missing).copied().collect();
            reads.extend(missing);
        }
    }
    // contacts that do not fit are counted in what is shown, too
    let is_kept = |array: &Array| wanted.contains(array) || *array == Array::LeftOut;
    let writes: Vec<Array> = written.into_iter().filter(is_kept).collect();
    let recording = between(m, &reads, &writes, |cx, b| {
        how.prepare(cx);
        stages.iter().for_each(|stage| run(*stage, cx, m, b));
        let mut rows = Vec::new();
        for &(field, numbers) in computed {
            let mut row = vec![Recorded::c(0.0); numbers];
            gather(cx, m, b, field, &mut row);
            rows.extend(row);
        }
        rows
    })?;
    let inputs = reads
        .iter()
        .flat_map(|array| places.range(*array))
        .collect();
    let mut outputs = Vec::new();
    for array in &writes {
        match array {
            // the solver's next start stays as it is
            Array::JointQdd => {
                let first = places.shown_qdd;
                outputs.extend(first..first + m.dofs.len() as u32);
            }
            _ => outputs.extend(places.range(*array)),
        }
    }
    for &(field, numbers) in computed {
        let first = places.computed(field);
        outputs.extend(first..first + numbers as u32);
    }
    Ok((recording, options(inputs, outputs)))
}

fn options(inputs: Vec<u32>, outputs: Vec<u32>) -> ProgramOptions {
    ProgramOptions {
        inputs: Some(inputs),
        outputs: Some(outputs),
        ..ProgramOptions::default()
    }
}
