//! What may watch a chunk run: nothing, or a profile.

use crate::backend::profile::Profile;
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
    pub memory: &'a [F],
    /// Lanes that hold a world.
    pub lanes: usize,
    /// The stage, by [`StageId::index`].
    pub stage: usize,
    /// Whether outputs are evaluated, instead of a step.
    pub evaluates: bool,
}

/// What watches a chunk run. `()` watches nothing, and costs nothing.
pub(super) trait Probe<F: Lane> {
    /// Before a stage.
    fn before(&mut self, _moment: Moment<'_, F>) {}
    /// After it.
    fn after(&mut self, _moment: Moment<'_, F>) {}
}

impl<F: Lane> Probe<F> for () {}

/// Fills a [`Profile`].
pub(super) struct Watch<'a, F> {
    profile: &'a mut Profile,
    begin: Instant,
    /// Time of the probe itself [ns].
    pub own_ns: u64,
    /// Contacts of each class before the stage.
    counts: Vec<F>,
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
    fn note_work(&mut self, stage: usize, lanes: usize, work: F) -> usize {
        let of_lanes = (0..lanes).map(|lane| work.lane(lane).to_usize());
        let most = of_lanes.clone().max().unwrap_or(0);
        let stage = &mut self.profile.stages[stage];
        stage.useful += of_lanes.sum::<usize>() as u64;
        stage.done += (most * lanes) as u64;
        most
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

    fn note_solve(&mut self, moment: &Moment<'_, F>) {
        let work = (
            &moment.block.solver_work[..],
            &moment.block.solver_block_work[..],
        );
        let (&[iterations, searches, evaluations], &[_, _, of_block]) = work else {
            unreachable!("three counts each")
        };
        let most = self.note_work(moment.stage, moment.lanes, iterations);
        if moment.evaluates {
            return;
        }
        self.profile.block_iterations.add(most);
        self.profile
            .block_evaluations
            .add(of_block.lane(0).to_usize());
        let rows = moment.constants.rows();
        for lane in 0..moment.lanes {
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
    fn before(&mut self, moment: Moment<'_, F>) {
        // they count on in all steps
        moment.block.solver_work.fill(F::c(0.0));
        moment.block.solver_block_work.fill(F::c(0.0));
        self.begin = Instant::now();
    }

    fn after(&mut self, moment: Moment<'_, F>) {
        let end = Instant::now();
        let took = (end - self.begin).as_nanos() as u64;
        let stage = &mut self.profile.stages[moment.stage];
        if moment.evaluates {
            stage.evaluation_ns += took;
        } else {
            stage.step_ns += took;
        }
        if self.solver.contains(&moment.stage) {
            self.note_solve(&moment);
        }
        if moment.stage == self.place {
            self.counts.fill(F::c(0.0));
        } else if (self.place..=self.contact_rows).contains(&moment.stage) {
            self.note_contacts(&moment);
        }
        self.own_ns += end.elapsed().as_nanos() as u64;
    }
}
