//! What may watch a chunk run: nothing, or a profile.

use crate::backend::profile::{Part, Profile};
use sim_physics::arrays::Block;
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{pair, row};
use sim_physics::lane::{Lane, Real};
use sim_physics::step::StageId;
use std::time::Instant;

/// A stage that is about to run, or has run.
pub(super) struct Moment<'a, F: Lane> {
    pub constants: &'a Constants<F::Real>,
    pub block: &'a mut Block<F, F>,
    pub memory: &'a mut [F],
    /// Lanes that hold a world.
    pub lanes: usize,
    /// The stage, by [`StageId::index`].
    pub stage: usize,
    /// Whether outputs are evaluated, instead of a step.
    pub evaluates: bool,
}

/// What watches a chunk run. `()` watches nothing, and costs nothing.
pub(super) trait Probe<F: Lane> {
    /// Does it watch stages?
    const WATCHES: bool = true;
    /// Before a stage.
    fn before(&mut self, _moment: &mut Moment<'_, F>) {}
    /// After it.
    fn after(&mut self, _moment: &mut Moment<'_, F>) {}
    /// After a part of what happens between stages; it began where the last stage or part ended.
    fn after_part(&mut self, _part: Part) {}
    /// Worlds moved to a gathered block.
    fn note_moves(&mut self, _worlds: usize) {}
}

impl<F: Lane> Probe<F> for () {
    const WATCHES: bool = false;
}

/// Fills a [`Profile`].
pub(super) struct Watch<'a, F> {
    profile: &'a mut Profile,
    begin: Instant,
    /// Time of the probe itself [ns].
    pub own_ns: u64,
    /// Contacts of each class before the stage.
    counts: Vec<F>,
    /// Iterations of each world before the stage, where a solve goes on.
    iterations: F,
    place: usize,
    contact_rows: usize,
    solver: [usize; 2],
}

impl<'a, F: Lane> Watch<'a, F> {
    pub fn new(profile: &'a mut Profile, m: &Constants<F::Real>) -> Self {
        let place = |name| StageId::named(name).expect("a stage").index();
        Watch {
            profile,
            begin: Instant::now(),
            own_ns: 0,
            counts: vec![F::c(0.0); m.contacts.classes.len()],
            iterations: F::c(0.0),
            place: place("place"),
            contact_rows: place("contact_rows"),
            solver: ["solver", "solver_turning"].map(place),
        }
    }

    /// Contacts of each class in the block now.
    fn count<'m>(moment: &'m Moment<'_, F>) -> impl Iterator<Item = F> + use<'m, F> {
        let (classes, counts) = (
            &moment.constants.contacts.classes,
            moment.constants.contacts.memory.counts,
        );
        let counts =
            (0..classes.len()).map(move |k| moment.memory[counts.base + k * counts.stride]);
        let kept = counts.zip(classes);
        kept.map(|(count, class)| count.min(F::c(class.capacity as f64)))
    }

    /// What the worlds of a block did of some work, and what the block did for it.
    fn note_work(&mut self, stage: usize, lanes: usize, work: F) {
        let of_lanes = (0..lanes).map(|lane| work.lane(lane).to_usize());
        let most = of_lanes.clone().max().unwrap_or(0);
        self.profile.stages[stage]
            .work
            .add(of_lanes.sum(), most * lanes);
    }

    /// Contacts that a narrow phase found, or of which rows were made.
    fn note_contacts(&mut self, moment: &Moment<'_, F>) {
        let is_rows = moment.stage == self.contact_rows;
        for (k, count) in Watch::count(moment).enumerate() {
            let new = if is_rows {
                count
            } else {
                count - self.counts[k]
            };
            self.counts[k] = count;
            if F::any(F::c(0.5).lt(new)) {
                self.note_work(moment.stage, moment.lanes, new);
            }
        }
    }

    /// What the worlds of a block needed of the contacts and coupled systems that a call of its solver visited, in every iteration.
    fn note_visits(&mut self, moment: &Moment<'_, F>) {
        let p = &mut *self.profile;
        let since = moment.block.solver_work[0] - self.iterations;
        let iterations: Vec<usize> = (0..moment.lanes)
            .map(|lane| since.lane(lane).to_usize())
            .collect();
        // a contact is visited while a world that has it goes on, and so is the larger system
        let executed = |iterations: usize| iterations * lanes_of(moment);
        let mut coupled = vec![false; moment.lanes];
        let classes = &moment.constants.contacts.classes;
        for (class, count) in classes.iter().zip(Watch::count(moment)) {
            let counts = || {
                let lanes = iterations.iter().enumerate();
                let busy = lanes.filter(|&(_, &iterations)| iterations > 0);
                busy.map(|(lane, &n)| (lane, n, count.lane(lane).to_usize()))
            };
            for contact in 0..counts().map(|(_, _, count)| count).max().unwrap_or(0) {
                let having = || counts().filter(|&(_, _, count)| count > contact);
                p.contact_lanes.add(having().count());
                let most = having().map(|(_, n, _)| n).max().unwrap_or(0);
                let needed = having().map(|(_, n, _)| n).sum();
                p.lane_contacts.add(needed, executed(most));
            }
            if class.couples {
                counts().for_each(|(lane, _, count)| coupled[lane] |= count > 0);
            }
        }
        let coupling = coupled.iter().zip(&iterations);
        let coupling = coupling.filter(|(couples, _)| **couples).map(|(_, n)| *n);
        let most = coupling.clone().max().unwrap_or(0);
        p.lane_couplings.add(coupling.sum(), executed(most));
    }

    fn note_solve(&mut self, moment: &Moment<'_, F>) {
        let work = (
            &moment.block.solver_work[..],
            &moment.block.solver_block_work[..],
        );
        let (&[iterations, searches, evaluations], &[block_iterations, _, block_evaluations]) =
            work
        else {
            unreachable!("three counts each")
        };
        let (lanes, pause) = (moment.lanes, moment.block.pause);
        let of_block = [block_iterations, block_evaluations].map(|x| x.lane(0).to_usize());
        let executed = of_block.map(|count| count * lanes_of(moment));
        // worlds of a block that paused are counted where their solve ends
        let ends = !pause.paused;
        let needed = [iterations, evaluations].map(|work| match ends {
            true => (0..lanes).map(|lane| work.lane(lane).to_usize()).sum(),
            false => 0,
        });
        let stage = &mut self.profile.stages[moment.stage];
        stage.work.add(needed[0], executed[0]);
        if moment.evaluates {
            return;
        }
        self.profile.lane_iterations.add(needed[0], executed[0]);
        self.profile.lane_evaluations.add(needed[1], executed[1]);
        self.note_visits(moment);
        if !pause.resumes {
            self.profile.block_iterations.add(of_block[0]);
            self.profile.block_evaluations.add(of_block[1]);
        }
        if !ends {
            return;
        }
        let rows = moment.constants.rows();
        for lane in 0..lanes {
            let count = |x: F| x.lane(lane).to_usize();
            self.profile.iterations.add(count(iterations));
            self.profile.searches.add(count(searches));
            self.profile.evaluations.add(count(evaluations));
            let weights = moment.block.efc_weight[..rows].iter();
            let acting = weights.filter(|weight| weight.lane(lane).to_f64() > 0.0);
            let (contacts, contact_rows) = contacts_of(moment, lane);
            self.profile.contacts.add(contacts);
            self.profile.rows.add(acting.count() + contact_rows);
        }
    }
}

/// The lanes that a block's work counts for: of a gathered block all, since it is there to fill them.
fn lanes_of<F: Lane>(moment: &Moment<'_, F>) -> usize {
    match moment.block.pause.iterates {
        true => F::WIDTH,
        false => moment.lanes,
    }
}

/// Contacts of a world, and their rows.
fn contacts_of<F: Lane>(moment: &Moment<'_, F>, lane: usize) -> (usize, usize) {
    let t = &moment.constants.contacts;
    let (mut contacts, mut rows) = (0, 0);
    for (class, count) in t.classes.iter().zip(Watch::count(moment)) {
        let count = count.lane(lane).to_usize();
        contacts += count;
        for r in class.first..class.first + count {
            let at = t.memory.rows.base + r * t.memory.rows.stride + row::PAIR;
            let pair = moment.memory[at].lane(lane).to_usize();
            let numbers = t.handles.pair_numbers;
            rows += t.tables.numbers[numbers.base + pair * numbers.stride + pair::ROWS].to_usize();
        }
    }
    (contacts, rows)
}

impl<F: Lane> Probe<F> for Watch<'_, F> {
    fn before(&mut self, moment: &mut Moment<'_, F>) {
        // they count on in all steps
        if !moment.block.pause.resumes {
            moment.block.solver_work.fill(F::c(0.0));
        }
        self.iterations = moment.block.solver_work[0];
        moment.block.solver_block_work.fill(F::c(0.0));
        self.begin = Instant::now();
    }

    fn after(&mut self, moment: &mut Moment<'_, F>) {
        let end = Instant::now();
        let took = (end - self.begin).as_nanos() as u64;
        let stage = &mut self.profile.stages[moment.stage];
        if moment.evaluates {
            stage.evaluation_ns += took;
        } else {
            stage.step_ns += took;
        }
        if self.solver.contains(&moment.stage) {
            self.note_solve(moment);
        }
        if moment.stage == self.place {
            self.counts.fill(F::c(0.0));
        } else if (self.place..=self.contact_rows).contains(&moment.stage) {
            self.note_contacts(moment);
        }
        self.begin = Instant::now();
        self.own_ns += (self.begin - end).as_nanos() as u64;
    }

    fn note_moves(&mut self, worlds: usize) {
        self.profile.moves += worlds as u64;
    }

    fn after_part(&mut self, part: Part) {
        let end = Instant::now();
        self.profile.parts[part as usize] += (end - self.begin).as_nanos() as u64;
        self.begin = end;
    }
}
