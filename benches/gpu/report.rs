//! Results: printed, and written to a file.

use crate::measure::Frames;
use crate::scenes::Scene;
use anyhow::Context;
use sim_engine::options::AdapterInfo;
use sim_engine::simulation::ProgramInfo;
use std::path::Path;

/// A scene with so many worlds.
pub struct Row {
    pub scene: Scene,
    pub worlds: usize,
    pub dofs: usize,
    pub substeps: usize,
    pub programs: Vec<ProgramInfo>,
    /// Until worlds have made their first frame, in a process that finds nothing kept, and in one after it [s].
    pub cold_s: f64,
    pub cached_s: f64,
    /// Frames that the host copies, and that the device writes to their reader.
    pub staged: Frames,
    pub imported: Option<Frames>,
    /// Processor time of the thread that asks for a frame, its batches recorded and encoded each time [µs].
    pub replay: Option<[f64; 2]>,
    /// The processor's, on all cores.
    pub cpu: Option<Frames>,
}

/// A column: its name, and what stands in it.
type Cell = (&'static str, String);

impl Row {
    /// The frames that count: as they come to their readers.
    fn frames(&self) -> &Frames {
        self.imported.as_ref().unwrap_or(&self.staged)
    }

    fn cells(&self) -> Vec<Cell> {
        let frames = self.frames();
        let steps = self.worlds * self.substeps;
        let in_step = || self.programs.iter().filter(|p| p.dispatches.is_some());
        let dispatches: usize = self.programs.iter().filter_map(|p| p.dispatches).sum();
        let or_dash = |x: Option<f64>, digits: usize| match x {
            Some(x) => format!("{x:.digits$}"),
            None => "–".to_owned(),
        };
        let cpu = self.cpu.as_ref().map(|cpu| cpu.rate(steps));
        vec![
            ("scene", self.scene.name().to_owned()),
            ("worlds", self.worlds.to_string()),
            ("dofs", self.dofs.to_string()),
            ("kernels", in_step().count().to_string()),
            ("dispatches", dispatches.to_string()),
            (
                "statements",
                in_step().map(|p| p.statements).sum::<usize>().to_string(),
            ),
            ("cold_s", format!("{:.2}", self.cold_s)),
            ("cached_s", format!("{:.2}", self.cached_s)),
            ("steps_per_s", format!("{:.0}", frames.rate(steps))),
            (
                "steps_per_s_whole",
                format!("{:.0}", frames.whole_rate(steps)),
            ),
            ("frame_p50_ms", format!("{:.3}", frames.wall_ms(0.5))),
            ("frame_p99_ms", format!("{:.3}", frames.wall_ms(0.99))),
            ("staged_p50_ms", format!("{:.3}", self.staged.wall_ms(0.5))),
            (
                "imports",
                if self.imported.is_some() { "yes" } else { "no" }.to_owned(),
            ),
            ("submit_us", format!("{:.0}", frames.thread_us(0.5))),
            ("recorded_us", or_dash(self.replay.map(|r| r[0]), 0)),
            ("encoded_us", or_dash(self.replay.map(|r| r[1]), 0)),
            (
                "encoded_over_recorded",
                or_dash(self.replay.map(|r| r[1] / r[0]), 1),
            ),
            ("frames", frames.len().to_string()),
            ("cut", if frames.is_cut { "yes" } else { "no" }.to_owned()),
            ("cpu_steps_per_s", or_dash(cpu, 0)),
            (
                "gpu_over_cpu",
                or_dash(cpu.map(|cpu| frames.rate(steps) / cpu), 2),
            ),
        ]
    }
}

/// All rows, and what stands above them.
pub struct Report {
    facts: Vec<(String, String)>,
    rows: Vec<Row>,
}

impl Report {
    /// Says what is measured.
    pub fn new(info: &AdapterInfo, given: &[String]) -> Report {
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let memory = info.memory.map_or("unknown".to_owned(), |bytes| {
            format!("{:.1} GB", bytes as f64 * 1e-9)
        });
        let fact = |name: &str, value: String| (name.to_owned(), value);
        let mut facts = vec![
            fact("adapter", info.name.clone()),
            fact("kind", format!("{:?}, {}", info.kind, info.backend)),
            fact("driver", info.driver.clone()),
            fact("memory", memory),
            fact(
                "cpu",
                format!("{}, {cores} cores for this run", processor()),
            ),
            fact(
                "command",
                std::env::args().skip(1).collect::<Vec<_>>().join(" "),
            ),
            fact("version", env!("CARGO_PKG_VERSION").to_owned()),
        ];
        for text in given {
            let (name, value) = text.split_once(": ").unwrap_or(("note", text));
            facts.push(fact(name, value.to_owned()));
        }
        for (name, value) in &facts {
            println!("{name}: {value}");
        }
        println!();
        let rows = Vec::new();
        Report { facts, rows }
    }

    /// The names of the columns.
    pub fn head(&self) {
        println!();
        println!(
            "{:<12}{:>7}{:>8}{:>12}{:>8}{:>9}{:>14}{:>14}{:>10}{:>10}{:>11}{:>11}{:>12}{:>9}{:>14}{:>8}",
            "scene",
            "worlds",
            "kernels",
            "statements",
            "cold s",
            "cached s",
            "steps/s",
            "of whole run",
            "p50 ms",
            "p99 ms",
            "staged ms",
            "submit µs",
            "encoded µs",
            "replay",
            "CPU steps/s",
            "ratio"
        );
    }

    /// Shows and keeps a row.
    pub fn add(&mut self, row: Row) {
        let cells = row.cells();
        let cell = |name: &str| cells.iter().find(|c| c.0 == name).map_or("", |c| &c.1);
        println!(
            "{:<12}{:>7}{:>8}{:>12}{:>8}{:>9}{:>14}{:>14}{:>10}{:>10}{:>11}{:>11}{:>12}{:>9}{:>14}{:>8}",
            cell("scene"),
            cell("worlds"),
            cell("kernels"),
            cell("statements"),
            cell("cold_s"),
            cell("cached_s"),
            cell("steps_per_s"),
            cell("steps_per_s_whole"),
            cell("frame_p50_ms"),
            cell("frame_p99_ms"),
            cell("staged_p50_ms"),
            cell("submit_us"),
            cell("encoded_us"),
            cell("encoded_over_recorded"),
            cell("cpu_steps_per_s"),
            cell("gpu_over_cpu")
        );
        self.rows.push(row);
    }

    /// What to know of the columns.
    pub fn notes(&self) {
        println!(
            "\ncold: until the first frame is there, in a process of its own for which neither we nor the driver have kept anything;\n\
             cached: in a process after it. Drivers that keep what they compile elsewhere than Mesa's and NVIDIA's are not cold.\n\
             steps/s: physics steps of all worlds in the median frame, commands to arrays; `staged ms`: the median frame where the host copies it.\n\
             submit: processor time of the thread that asks for a frame; `replay`: the same for 64 worlds with batches encoded each time, over that with recorded ones.\n\
             CPU: the same worlds, commands and fields on all cores of this machine, f32 as well; ratio: the GPU's steps/s over the CPU's."
        );
        for row in self.rows.iter().filter(|row| row.frames().is_cut) {
            let (scene, frames) = (row.scene.name(), row.frames().len());
            println!(
                "{scene} with {} worlds: too slow for a whole run, {frames} frames",
                row.worlds
            );
        }
    }

    /// Writes the file.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        let mut text = String::new();
        for (name, value) in &self.facts {
            text += &format!("# {name}: {value}\n");
        }
        for (k, row) in self.rows.iter().enumerate() {
            let (names, values): (Vec<_>, Vec<_>) = row.cells().into_iter().unzip();
            if k == 0 {
                text += &(names.join(",") + "\n");
            }
            text += &(values.join(",") + "\n");
        }
        let path_name = || format!("{}", path.display());
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).with_context(path_name)?;
        }
        std::fs::write(path, text).with_context(path_name)?;
        println!("\nresults: {}", path.display());
        Ok(())
    }
}

/// Name of the processor, as Linux has it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split(": ").nth(1));
    name.unwrap_or("unknown").to_owned()
}
