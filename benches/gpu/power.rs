//! Energy that a card takes, where its driver counts it: NVIDIA's does.

use crate::scenes::{Plan, WorldSet};
use nvml_wrapper::Nvml;
use sim_engine::backend::Values;
use sim_engine::simulation::Simulation;
use std::time::{Duration, Instant};

/// What a card takes for runs one after the other, with the resets between them.
pub struct Power {
    /// Mean power [W].
    pub watts: f64,
    /// Energy of a frame [J].
    pub frame_j: f64,
}

/// How long an update of the counter is waited for.
const PATIENCE: Duration = Duration::from_secs(1);

/// The counter of a card.
pub struct Meter {
    nvml: Nvml,
    index: u32,
}

impl Meter {
    /// The counter of an adapter, if it is the only card of its name.
    pub fn new(adapter: &str) -> Option<Meter> {
        let nvml = Nvml::init().ok()?;
        let name = |index: u32| nvml.device_by_index(index).and_then(|card| card.name());
        let cards = 0..nvml.device_count().ok()?;
        let meant = cards.filter(|index| name(*index).is_ok_and(|name| name == adapter));
        match meant.collect::<Vec<_>>()[..] {
            [index] => Some(Meter { nvml, index }),
            _ => None,
        }
    }

    /// Waits until the driver updates its counter, some ten times a second. When that was, and the energy until then [J].
    fn tick(&self) -> Option<(Instant, f64)> {
        let card = self.nvml.device_by_index(self.index).ok()?;
        let before = card.total_energy_consumption().ok()?;
        let since = Instant::now();
        while since.elapsed() < PATIENCE {
            let now = card.total_energy_consumption().ok()?;
            if now != before {
                return Some((Instant::now(), 1e-3 * now as f64));
            }
        }
        None
    }

    /// Measures a plan for at least `wanted`; none where the driver does not count.
    pub fn measure(
        &self,
        sim: &mut Simulation,
        plan: &Plan,
        crowd: &WorldSet,
        words: &mut [u64],
        wanted: Duration,
    ) -> anyhow::Result<Option<Power>> {
        let commands = plan.commands(crowd, usize::MAX);
        let Some((since, before)) = self.tick() else {
            return Ok(None);
        };
        let mut frames = 0;
        while since.elapsed() < wanted {
            plan.start(sim, crowd);
            for values in &commands {
                sim.command(plan.field, 0..plan.columns(), Values::F32(values))?;
                sim.step(words);
                frames += 1;
                if since.elapsed() >= wanted {
                    break;
                }
            }
        }
        // the card idles until the last update: a few percent of a second
        Ok(self.tick().map(|(end, now)| Power {
            watts: (now - before) / (end - since).as_secs_f64(),
            frame_j: (now - before) / f64::from(frames),
        }))
    }
}
