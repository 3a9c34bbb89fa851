//! A stage as a program of a GPU, by itself.

use super::worlds::{Given, Left};
use sim_device::{Choice, Device, Program, Replay, Source, Staging};
use sim_physics::constants::Constants;
use sim_physics::step::StageId;
use sim_record::Recording;
use sim_record::wgsl::{ProgramOptions, wgsl};
use std::ops::Range;
use std::time::Duration;

/// Longer than any program here takes on a busy computer.
const PATIENCE: Duration = Duration::from_secs(300);
const WORKGROUP: u32 = 32;
/// Numbers of a vector.
const WIDTH: usize = 4;

/// A program of a stage.
struct Kernel {
    stage: StageId,
    /// None where the stage has nothing to leave.
    program: Option<Program>,
    inputs: usize,
    outputs: usize,
}

/// Programs of the stages of a model, and its tables.
pub struct Gpu {
    kernels: Vec<Kernel>,
    numbers: Staging,
    indices: Staging,
    worlds: usize,
    device: Device,
}

impl Gpu {
    /// Compiles stages of a model for so many worlds.
    pub fn new(m: &Constants<f32>, stages: &[StageId], worlds: usize) -> Gpu {
        let device = Device::open(&Choice::First, None).expect("the tests need an adapter");
        let recordings: Vec<_> = (stages.iter())
            .map(|&stage| {
                stages_recorded::between(m, stage.reads(), stage.writes(), |cx, b| {
                    stages_recorded::run(stage, cx, m, b);
                    Vec::new()
                })
                .unwrap_or_else(|e| panic!("{}: {e}", stage.name()))
            })
            .collect();
        let leaves = |recording: &Recording| recording.outputs() + recording.scratch() > 0;
        let sources: Vec<Source> = (stages.iter().zip(&recordings))
            .filter(|(_, recording)| leaves(recording))
            .map(|(stage, recording)| Source {
                label: stage.name().to_owned(),
                // input i is number i of the fields, and the outputs follow
                wgsl: wgsl(recording, &ProgramOptions::default()),
                entry: "main".to_owned(),
                constants: vec![
                    ("worlds".to_owned(), worlds as f64),
                    ("workgroup".to_owned(), f64::from(WORKGROUP)),
                ],
            })
            .collect();
        let programs = device
            .programs(&sources, PATIENCE)
            .unwrap_or_else(|e| panic!("{e}"));
        let mut programs = programs.into_iter();
        let kernels = (stages.iter().zip(&recordings))
            .map(|(&stage, recording)| Kernel {
                stage,
                program: leaves(recording).then(|| programs.next().expect("one a source")),
                inputs: recording.inputs(),
                outputs: recording.outputs(),
            })
            .collect();
        let tables = &m.contacts.tables;
        let numbers = staged(&device, "numbers", bytemuck::cast_slice(&tables.numbers));
        let indices = staged(&device, "indices", bytemuck::cast_slice(&tables.indices));
        Gpu {
            kernels,
            numbers,
            indices,
            worlds,
            device,
        }
    }

    /// Runs a stage.
    pub fn run(&self, stage: StageId, given: &[Given]) -> Vec<Left> {
        assert_eq!(given.len(), self.worlds);
        let kernel = self.kernels.iter().find(|kernel| kernel.stage == stage);
        let kernel = kernel.expect("it was compiled");
        let mut fields = vec![0.0; self.packed(kernel.inputs + kernel.outputs)];
        let mut scratch = vec![0.0; self.packed(given[0].memory.len())];
        for (w, world) in given.iter().enumerate() {
            assert_eq!(world.numbers.len(), kernel.inputs);
            self.pack(&world.numbers, w, &mut fields);
            self.pack(&world.memory, w, &mut scratch);
        }
        let fields = staged(&self.device, "fields", bytemuck::cast_slice(&fields));
        let scratch = staged(&self.device, "scratch", bytemuck::cast_slice(&scratch));
        let buffers = [
            (0, &*fields, 0..fields.bytes()),
            (1, &*scratch, 0..scratch.bytes()),
            (2, &*self.numbers, 0..self.numbers.bytes()),
            (3, &*self.indices, 0..self.indices.bytes()),
        ];
        let mut batch = self.device.batch(Replay::Recorded);
        if let Some(program) = &kernel.program {
            let workgroups = (self.worlds as u32).div_ceil(WORKGROUP);
            batch.dispatch(program, &buffers, workgroups);
        }
        let batch = batch.finish().unwrap_or_else(|e| panic!("{e}"));
        self.device
            .run(&[&batch])
            .unwrap_or_else(|e| panic!("{}: {e}", stage.name()));
        let (fields, scratch) = (fields.read(), scratch.read());
        let fields: &[f32] = bytemuck::cast_slice(&fields);
        let scratch: &[f32] = bytemuck::cast_slice(&scratch);
        let numbers = kernel.inputs..kernel.inputs + kernel.outputs;
        (0..self.worlds)
            .map(|w| Left {
                numbers: self.unpack(fields, w, numbers.clone()),
                memory: self.unpack(scratch, w, 0..given[w].memory.len()),
            })
            .collect()
    }

    /// Puts the numbers of world w where its threads look for them: number i lies in component i % 4 of vector i / 4.
    ///
    /// This crate is compiled without optimisation, and there are many numbers: so a plain loop.
    fn pack(&self, numbers: &[f64], w: usize, to: &mut [f32]) {
        let mut i = 0;
        while i < numbers.len() {
            to[(i / WIDTH * self.worlds + w) * WIDTH + i % WIDTH] = numbers[i] as f32;
            i += 1;
        }
    }

    /// The reverse.
    fn unpack(&self, from: &[f32], w: usize, range: Range<usize>) -> Vec<f64> {
        let mut numbers = vec![0.0; range.len()];
        let to: &mut [f64] = &mut numbers;
        let mut k = 0;
        while k < to.len() {
            let i = range.start + k;
            to[k] = f64::from(from[(i / WIDTH * self.worlds + w) * WIDTH + i % WIDTH]);
            k += 1;
        }
        numbers
    }

    /// Room for so many numbers of all worlds.
    fn packed(&self, numbers: usize) -> usize {
        numbers.div_ceil(WIDTH) * WIDTH * self.worlds
    }
}

/// Memory of the host with these bytes.
fn staged(device: &Device, label: &str, bytes: &[u8]) -> Staging {
    let staging = device
        .staging(label, bytes.len().max(16) as u64)
        .unwrap_or_else(|e| panic!("{e}"));
    staging.write()[..bytes.len()].copy_from_slice(bytes);
    staging
}
