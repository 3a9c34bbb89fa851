//! `tightloop compile`: the machine code of a scene's model, or its kernels, for people.

mod kernels;
mod listing;

use sim_engine::backend::{Lanes, cpu, gpu};
use sim_engine::simulation::{Options, Simulation};

use crate::cli::Compile;
use crate::error::DaemonError;
use crate::output;
use crate::serve::read_scene;

/// Prints the machine code of a scene's model, or its kernels. The processor need not have its instructions, nor the computer a GPU.
pub(crate) fn run(args: &Compile) -> Result<(), DaemonError> {
    if args.gpu && args.lanes.is_some() {
        return Err(DaemonError::Argument {
            argument: "lanes",
            value: args.lanes.unwrap_or_default().to_string(),
            problem: "a GPU has none; leave it out".to_owned(),
        });
    }
    let worlds = match args.lanes {
        None if cpu::available(Lanes::Sixteen) => 16,
        None => 8,
        Some(worlds @ (8 | 16)) => worlds,
        Some(other) => {
            return Err(DaemonError::Argument {
                argument: "lanes",
                value: other.to_string(),
                problem: "unknown; use 8 or 16".to_owned(),
            });
        }
    };
    let (scene, folder) = read_scene(&args.scene)?;
    let model = scene.describe(&folder)?.compile()?;
    if args.gpu {
        let layout = Simulation::layout_of(&model, &Options::default());
        let kernels = gpu::listing(&model, &layout, None)?;
        let text = kernels::text(&kernels, args.listing);
        return output::print(text.as_bytes()).map_err(DaemonError::stdout);
    }
    let text = match cpu::listing(&model, worlds) {
        Ok(sections) if sections.is_empty() => {
            let why = match cfg!(target_arch = "x86_64") {
                true => "the model is too large",
                false => "there is no compiler for this kind of processor",
            };
            format!("no machine code: {why}. The stages run.\n")
        }
        Ok(sections) => listing::text(&sections, args.listing),
        Err(refusal) => format!("no machine code: {refusal}. The stages run.\n"),
    };
    output::print(text.as_bytes()).map_err(DaemonError::stdout)
}
