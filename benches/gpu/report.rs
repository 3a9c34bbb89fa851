//! Results: printed, and written to a file.

use crate::measure::Frames;
use crate::power::Power;
use crate::scenes::Scene;
use anyhow::{Context, ensure};
use sim_engine::options::{AdapterInfo, Cuts};
use sim_engine::simulation::ProgramInfo;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A scene with so many worlds.
pub struct Row {
    pub scene: Scene,
    pub worlds: usize,
    pub dofs: usize,
    pub substeps: usize,
    /// Threads per world and cuts that were asked for.
    pub world_threads: Option<usize>,
    /// One thread per world, with the bits of the CPU.
    pub cpu_bits: bool,
    pub cuts: Cuts,
    pub gpu: Option<GpuSide>,
    /// The processor's, on all cores.
    pub cpu: Option<Frames>,
}

/// What was measured of an adapter.
pub struct GpuSide {
    pub programs: Vec<ProgramInfo>,
    /// Until these worlds have made their first frame [s].
    pub build_s: f64,
    /// The same in a process that finds nothing kept, and in one after it [s].
    pub cold_and_cached_s: Option<[f64; 2]>,
    /// Frames that the host copies, and that the device writes to their reader.
    pub staged: Frames,
    pub imported: Option<Frames>,
    /// Processor time of the thread that asks for a frame, its batches recorded and encoded each time [µs].
    pub replay: Option<[f64; 2]>,
    /// Where the driver counts energy.
    pub power: Option<Power>,
}

impl GpuSide {
    /// The frames that count: as they come to their readers.
    fn frames(&self) -> &Frames {
        self.imported.as_ref().unwrap_or(&self.staged)
    }

    fn in_step(&self) -> impl Iterator<Item = &ProgramInfo> {
        self.programs.iter().filter(|p| p.dispatches.is_some())
    }
}

/// A number with so many digits, or a dash where there is none.
fn or_dash(x: Option<f64>, digits: usize) -> String {
    match x {
        Some(x) => format!("{x:.digits$}"),
        None => "–".to_owned(),
    }
}

/// A column: its name, and what stands in it.
type Cell = (&'static str, String);

impl Row {
    fn cells(&self) -> Vec<Cell> {
        let steps = self.worlds * self.substeps;
        let gpu = self.gpu.as_ref();
        let frames = gpu.map(GpuSide::frames);
        let count = |f: &dyn Fn(&GpuSide) -> usize| or_dash(gpu.map(|gpu| f(gpu) as f64), 0);
        let of_frames = |f: &dyn Fn(&Frames) -> f64, digits| or_dash(frames.map(f), digits);
        let builds = gpu.and_then(|gpu| gpu.cold_and_cached_s);
        let replay = gpu.and_then(|gpu| gpu.replay);
        let power = gpu.and_then(|gpu| gpu.power.as_ref());
        let rate = frames.map(|frames| frames.rate(steps));
        let cpu = self.cpu.as_ref().map(|cpu| cpu.rate(steps));
        let asked = |x: Option<usize>| x.map_or("auto".to_owned(), |x| x.to_string());
        let yes = |yes: bool| if yes { "yes" } else { "no" }.to_owned();
        let measured = frames.or(self.cpu.as_ref());
        vec![
            ("scene", self.scene.name().to_owned()),
            ("worlds", self.worlds.to_string()),
            ("dofs", self.dofs.to_string()),
            (
                "world_threads",
                match self.cpu_bits {
                    true => "1 (cpu bits)".to_owned(),
                    false => asked(self.world_threads),
                },
            ),
            ("kernel_size", asked(self.cuts.kernel)),
            ("dispatch_price", asked(self.cuts.dispatch)),
            ("kernels", count(&|gpu| gpu.in_step().count())),
            (
                "dispatches",
                count(&|gpu| gpu.in_step().filter_map(|p| p.dispatches).sum()),
            ),
            (
                "statements",
                count(&|gpu| gpu.in_step().map(|p| p.statements).sum()),
            ),
            ("build_s", or_dash(gpu.map(|gpu| gpu.build_s), 2)),
            ("cold_s", or_dash(builds.map(|b| b[0]), 2)),
            ("cached_s", or_dash(builds.map(|b| b[1]), 2)),
            ("steps_per_s", or_dash(rate, 0)),
            (
                "steps_per_s_whole",
                of_frames(&|frames| frames.whole_rate(steps), 0),
            ),
            ("power_w", or_dash(power.map(|power| power.watts), 0)),
            (
                "energy_uj",
                or_dash(power.map(|power| 1e6 * power.frame_j / steps as f64), 2),
            ),
            ("frame_p50_ms", of_frames(&|frames| frames.wall_ms(0.5), 3)),
            ("frame_p99_ms", of_frames(&|frames| frames.wall_ms(0.99), 3)),
            (
                "staged_p50_ms",
                or_dash(gpu.map(|gpu| gpu.staged.wall_ms(0.5)), 3),
            ),
            (
                "imports",
                yes(gpu.is_some_and(|gpu| gpu.imported.is_some())),
            ),
            ("submit_us", of_frames(&|frames| frames.thread_us(0.5), 0)),
            ("recorded_us", or_dash(replay.map(|r| r[0]), 0)),
            ("encoded_us", or_dash(replay.map(|r| r[1]), 0)),
            (
                "encoded_over_recorded",
                or_dash(replay.map(|r| r[1] / r[0]), 1),
            ),
            ("frames", measured.map_or(0, Frames::len).to_string()),
            ("cut", yes(measured.is_some_and(|frames| frames.is_cut))),
            ("cpu_steps_per_s", or_dash(cpu, 0)),
            (
                "gpu_over_cpu",
                or_dash(rate.zip(cpu).map(|(gpu, cpu)| gpu / cpu), 2),
            ),
        ]
    }
}

/// All rows, what stands above them, and the file that gets them one by one.
pub struct Report {
    facts: Vec<(String, String)>,
    rows: Vec<Row>,
    csv: Option<PathBuf>,
}

impl Report {
    /// Says what is measured. Without `appends` the file begins anew.
    pub fn new(
        info: &AdapterInfo,
        given: &[String],
        csv: Option<&Path>,
        appends: bool,
    ) -> anyhow::Result<Report> {
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
        if let Some(path) = csv.filter(|path| path.exists() && !appends) {
            fs::remove_file(path).with_context(|| path.display().to_string())?;
        }
        Ok(Report {
            facts,
            rows: Vec::new(),
            csv: csv.map(Path::to_owned),
        })
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
    pub fn add(&mut self, row: Row) -> anyhow::Result<()> {
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
        if let Some(path) = &self.csv {
            self.keep(&cells, path)
                .with_context(|| path.display().to_string())?;
        }
        self.rows.push(row);
        Ok(())
    }

    /// What to know of the columns.
    pub fn notes(&self) {
        println!(
            "\ncold: until the first frame is there, in a process of its own for which neither we nor the driver have kept anything;\n\
             cached: in a process after it. Drivers that keep what they compile elsewhere than Mesa's and NVIDIA's are not cold.\n\
             steps/s: physics steps of all worlds in the median frame, commands to arrays; `staged ms`: the median frame where the host copies it.\n\
             power_w, energy_uj in the file: mean power of the card in runs one after the other [W], and energy per step [µJ].\n\
             submit: processor time of the thread that asks for a frame; `replay`: the same for 64 worlds with batches encoded each time, over that with recorded ones.\n\
             CPU: the same worlds, commands and fields on all cores of this machine, f32 as well; ratio: the GPU's steps/s over the CPU's."
        );
        for row in &self.rows {
            let gpu = row.gpu.as_ref().map(GpuSide::frames);
            for frames in gpu.into_iter().chain(&row.cpu).filter(|f| f.is_cut) {
                let (scene, worlds, frames) = (row.scene.name(), row.worlds, frames.len());
                println!("{scene} with {worlds} worlds: too slow for a whole run, {frames} frames");
            }
        }
        if let Some(path) = &self.csv {
            println!("\nresults: {}", path.display());
        }
    }

    /// Adds a row to the file, below the facts and the names of the columns.
    fn keep(&self, cells: &[Cell], path: &Path) -> anyhow::Result<()> {
        let (names, values): (Vec<_>, Vec<&str>) =
            cells.iter().map(|(name, value)| (*name, &**value)).unzip();
        let names = names.join(",");
        let mut text = String::new();
        if !path.exists() {
            if let Some(folder) = path.parent() {
                fs::create_dir_all(folder)?;
            }
            for (name, value) in &self.facts {
                text += &format!("# {name}: {value}\n");
            }
            text += &(names + "\n");
        } else {
            let there = fs::read_to_string(path)?;
            let head = there.lines().find(|line| !line.starts_with('#'));
            ensure!(
                head == Some(&names),
                "it has other columns; delete it, or leave `--append` out"
            );
        }
        text += &(values.join(",") + "\n");
        let mut file = OpenOptions::new().create(true).append(true).open(path)?;
        Ok(file.write_all(text.as_bytes())?)
    }
}

/// Name of the processor, as Linux has it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split(": ").nth(1));
    name.unwrap_or("unknown").to_owned()
}
