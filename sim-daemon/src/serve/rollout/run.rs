//! Carries out a rollout, frame by frame.

use std::path::Path;

use sim_engine::simulation::{Precision, Simulation};
use sim_physics::arrays::status;
use sim_policy::Runner;
use sim_protocol::host::{FrameMemory, Host, Worlds};
use sim_protocol::{RefusalKind, Table};

use super::answer::Answer;
use super::commands::Commands;
use super::memory::{Memory, Places};
use super::observation::{Observation, Real};
use super::question::Asked;
use super::steps::Steps;
use crate::export::refusal::{Refusal, refusal};
use crate::export::{self, Advance, snapshot};
use crate::eyes::Eyes;
use crate::serve::exchange::Exchange;
use crate::serve::shown::Shown;

/// Memory that rollouts use again.
#[derive(Default)]
pub(crate) struct Rollouts {
    /// The last frame.
    arena: Vec<u64>,
    /// Lease and number of the command that left it, as long as nothing else has moved the worlds.
    left: Option<(u64, u64)>,
    mask: Vec<bool>,
}

impl Rollouts {
    /// Carries out the rollout that the file of the command asks for, and writes the answer into it.
    pub(crate) fn answer(
        &mut self,
        simulation: &mut Simulation,
        eyes: &mut Eyes,
        host: &mut Host,
        watched: usize,
    ) -> Result<Advance, Refusal> {
        let left = self.left.take();
        let advance = export::apply(simulation, host.inbox(), &mut self.mask)?;
        let path = snapshot::path(host.inbox())?.to_owned();
        let in_file = |problem: String| refused(&format!("{}: {problem}", path.display()));
        let exchange = Exchange::read(Path::new(&path), 4).map_err(in_file)?;
        let (epoch, seq) = (host.inbox().header().epoch, host.inbox().header().seq);
        let follows = left == Some((epoch, seq.wrapping_sub(1)));
        let bytes = self.carry_out(&exchange, follows, (simulation, eyes), host, watched)?;
        exchange.answer(&bytes).map_err(in_file)?;
        self.left = Some((epoch, seq));
        Ok(advance)
    }

    /// Carries out the rollout that a file asks for, and returns the answer. `follows` where nothing has moved the worlds since
    /// the last one.
    pub(crate) fn carry_out(
        &mut self,
        exchange: &Exchange,
        follows: bool,
        (simulation, eyes): (&mut Simulation, &mut Eyes),
        steps: &mut impl Steps,
        watched: usize,
    ) -> Result<Vec<u8>, Refusal> {
        let asked = Asked::parse(exchange, simulation.worlds());
        let asked = asked.map_err(|problem| refused(&problem))?;
        // a rollout comes in pieces, or goes on with memory: an evaluation between them might reset faulted worlds
        let is_next = asked.question.first > 0 || !asked.memory.is_empty();
        if !(is_next && follows) {
            self.arena
                .resize(eyes.images().arena_bytes().div_ceil(8), 0);
            // the policy sees the present state, which no frame may have shown
            simulation.forward(&mut self.arena);
            eyes.draw(simulation, &mut self.arena, false);
        }
        match simulation.precision() {
            Precision::F32 => self.run::<f32>(&asked, (simulation, eyes), steps, watched),
            Precision::F64 => self.run::<f64>(&asked, (simulation, eyes), steps, watched),
        }
    }

    /// The worlds at the end of a rollout: its last frame, not another evaluation.
    pub(crate) fn end<'a>(&'a self, shown: Shown<'a>) -> End<'a> {
        End {
            arena: &self.arena,
            shown,
        }
    }

    /// The worlds move without a rollout.
    pub(crate) fn forget(&mut self) {
        self.left = None;
    }

    fn run<R: Real>(
        &mut self,
        asked: &Asked,
        (simulation, eyes): (&mut Simulation, &mut Eyes),
        steps: &mut impl Steps,
        watched: usize,
    ) -> Result<Vec<u8>, Refusal> {
        let refuse = |problem: String| refused(&problem);
        let (worlds, threads) = (simulation.worlds(), simulation.threads());
        let table = export::frame_table(simulation.layout(), eyes.images());
        let mut observation = Observation::<R>::find(asked, &table).map_err(refuse)?;
        let commands = Commands::find(asked, steps.description()).map_err(refuse)?;
        let actions = asked.network.outputs();
        let inputs = asked.network.inputs();
        let terms = &asked.question.terms;
        let places = Places::lay_out(terms, observation.sizes(), actions, worlds);
        let places = places.map_err(refuse)?;
        let rows = (worlds as u64).saturating_mul((inputs + actions) as u64);
        let rows = rows.saturating_mul(size_of::<f32>() as u64);
        // memory is there twice at the end: for the policy, and in the answer
        let others = rows.saturating_add(places.bytes(worlds).saturating_mul(2));
        let answer = Answer::new(asked, worlds, &table, others, |needed| {
            steps.check_room(needed)
        });
        let answer = answer.map_err(refuse)?;
        let memory = Memory::new(places, worlds, asked.memory.clone());
        let mut memory = memory.map_err(refuse)?;
        let mut rollout = Rollout {
            asked,
            table: &table,
            observation: &mut observation,
            commands,
            memory: &mut memory,
            answer,
            runner: Runner::new(&asked.network),
            observations: vec![0.0; worlds * inputs],
            actions: vec![0.0; worlds * actions],
            episodes: vec![Episode::default(); worlds],
            threads,
            watched,
        };
        rollout.begin_anew(&self.arena);
        steps.put_aside();
        let frames = asked.question.frames;
        let result = (0..frames).try_for_each(|frame| {
            let step = rollout.step(
                frame,
                (simulation, eyes),
                steps,
                &mut self.arena,
                &mut self.mask,
            );
            step.map_err(|mut refusal| {
                let frame = asked.question.first.saturating_add(frame);
                refusal.reason = format!("rollout: frame {frame}: {}", refusal.reason);
                refusal
            })
        });
        steps.take_back();
        result?;
        Ok(rollout.answer.finish(memory.values()))
    }
}

/// The end of a rollout, for the client.
pub(crate) struct End<'a> {
    arena: &'a [u64],
    shown: Shown<'a>,
}

impl Worlds for End<'_> {
    fn frame(&mut self, arena: &mut [u64], _: Option<&FrameMemory>) -> bool {
        let words = arena.len().min(self.arena.len());
        arena[..words].copy_from_slice(&self.arena[..words]);
        self.shown.simulation.lost().is_none()
    }

    fn state(&mut self, to: &mut [u8]) -> bool {
        self.shown.state(to)
    }
}

/// A rollout on its way.
struct Rollout<'a, R> {
    asked: &'a Asked,
    table: &'a Table,
    observation: &'a mut Observation<R>,
    commands: Commands,
    memory: &'a mut Memory,
    answer: Answer,
    runner: Runner,
    /// `(worlds, inputs)` of the network.
    observations: Vec<f32>,
    /// `(worlds, outputs)` of the network, within bounds.
    actions: Vec<f32>,
    /// Of the last frame.
    episodes: Vec<Episode>,
    threads: usize,
    watched: usize,
}

impl<R: Real> Rollout<'_, R> {
    /// One control frame.
    fn step(
        &mut self,
        frame: usize,
        (simulation, eyes): (&mut Simulation, &mut Eyes),
        steps: &mut impl Steps,
        arena: &mut [u64],
        mask: &mut Vec<bool>,
    ) -> Result<(), Refusal> {
        self.observe(frame, arena);
        let run = self
            .runner
            .run(&self.observations, &mut self.actions, self.threads);
        run.map_err(|error| problem_of(error.to_string()))?;
        self.act();
        self.commands.set(self.asked, &self.actions, frame);
        steps.put_step(&self.commands.all()).map_err(problem_of)?;
        export::apply(simulation, steps.inbox(), mask)?;
        if let Some(sharing) = simulation.sharing() {
            sharing.stage_shared(&[]);
        }
        let mut shown = Shown {
            simulation,
            eyes,
            advance: Advance::Step,
            keeps: true,
            watched: self.watched,
        };
        let is_waited_for = steps.carry_out(arena, &mut shown);
        if let Some(lost) = simulation.lost() {
            return Err(refusal(RefusalKind::Backend, lost.to_string()));
        }
        if !is_waited_for {
            // not sent where the daemon ends
            let reason = "the client has gone; attach again".to_owned();
            return Err(refusal(RefusalKind::Stale, reason));
        }
        self.answer
            .collect(self.asked, frame, arena, &self.actions, &self.observations);
        // worlds that were reset have a new episode, and the policy with them
        for (world, now) in episodes(self.table, arena).enumerate() {
            let before = std::mem::replace(&mut self.episodes[world], now);
            let mut kept = self.memory.world(world);
            if now.steps < before.steps || before.is_frozen && !now.is_frozen {
                kept.clear();
            }
            kept.set_frozen(now.is_frozen);
        }
        Ok(())
    }

    /// Clears the memory of worlds that a fault had frozen, and that were reset since.
    fn begin_anew(&mut self, arena: &[u64]) {
        for (world, now) in episodes(self.table, arena).enumerate() {
            self.episodes[world] = now;
            let mut kept = self.memory.world(world);
            if kept.is_frozen() && !now.is_frozen {
                kept.clear();
            }
        }
    }

    fn observe(&mut self, frame: usize, arena: &[u64]) {
        let arena: &[R] = bytemuck::cast_slice(arena);
        let width = self.asked.network.inputs();
        for (world, row) in self.observations.chunks_exact_mut(width).enumerate() {
            self.observation
                .write(self.asked, self.memory, arena, (frame, world), row);
        }
    }

    /// Brings actions within their bounds, and remembers them.
    fn act(&mut self) {
        let width = self.asked.network.outputs();
        for (world, row) in self.actions.chunks_exact_mut(width).enumerate() {
            if let Some([low, high]) = &self.asked.question.clip {
                for ((value, &low), &high) in row.iter_mut().zip(low).zip(high) {
                    *value = value.clamp(low, high);
                }
            }
            let mut kept = self.memory.world(world);
            let last = kept.last_action().iter_mut();
            last.zip(row)
                .for_each(|(last, value)| *last = f64::from(*value));
        }
    }
}

/// Where each world of a frame is in its episode.
fn episodes<'a>(table: &Table, arena: &'a [u64]) -> impl Iterator<Item = Episode> + use<'a> {
    let bytes: &[u8] = bytemuck::cast_slice(arena);
    let counter = |name: &str| {
        let row = table.row(name).expect("every frame has it");
        &bytes[row.offset - Table::head_bytes(table.rows().len())..][..row.bytes]
    };
    let steps: &[u64] = bytemuck::cast_slice(counter("step"));
    let faults: &[u32] = bytemuck::cast_slice(counter("status"));
    let both = steps.iter().zip(faults);
    both.map(|(&steps, &faults)| Episode {
        steps,
        is_frozen: faults & status::FROZEN != 0,
    })
}

/// Where a world is in its episode.
#[derive(Clone, Copy, Default)]
struct Episode {
    /// Control frames since the reset.
    steps: u64,
    is_frozen: bool,
}

/// What is wrong with a frame, whose number is added later.
fn problem_of(reason: String) -> Refusal {
    refusal(RefusalKind::Backend, reason)
}

fn refused(problem: &str) -> Refusal {
    refusal(RefusalKind::Backend, format!("rollout: {problem}"))
}
