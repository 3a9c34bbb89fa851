//! Machine code as text.

use std::fmt::Write as _;

use sim_engine::backend::cpu::{ProgramListing, SectionListing};

/// What a stage's code adds up to.
struct Sum<'a> {
    stage: &'a str,
    bytes: usize,
    instructions: usize,
}

/// The sections of a substep: the size of each stage's code, and its instructions if `lists`.
pub(super) fn text(sections: &[SectionListing], lists: bool) -> String {
    let mut text = String::new();
    for section in sections {
        let first = section.stages.first().copied().unwrap_or_default();
        let last = section.stages.last().copied().unwrap_or_default();
        let _ = writeln!(text, "stages {first} to {last}");
        for program in &section.programs {
            text.push_str(match program.assumes {
                true => "\nprogram for blocks in which no joint is at a limit\n",
                false => "\nprogram for all blocks\n",
            });
            sizes(&mut text, program);
            if lists {
                instructions(&mut text, program);
            }
        }
        text.push('\n');
    }
    text
}

/// A table of stages.
fn sizes(text: &mut String, program: &ProgramListing) {
    let mut sums: Vec<Sum<'_>> = Vec::new();
    for line in &program.lines {
        let stage = line.part;
        let place = sums.iter().position(|sum| sum.stage == stage);
        let place = place.unwrap_or_else(|| {
            sums.push(Sum {
                stage,
                bytes: 0,
                instructions: 0,
            });
            sums.len() - 1
        });
        sums[place].bytes += line.bytes;
        sums[place].instructions += line.instructions.len();
    }
    sums.push(Sum {
        stage: "all",
        bytes: sums.iter().map(|sum| sum.bytes).sum(),
        instructions: sums.iter().map(|sum| sum.instructions).sum(),
    });
    let _ = writeln!(text, "{:<24}{:>9}{:>14}", "stage", "bytes", "instructions");
    for sum in sums {
        let _ = writeln!(
            text,
            "{:<24}{:>9}{:>14}",
            sum.stage, sum.bytes, sum.instructions
        );
    }
}

/// Instructions, below the operation of the code that they come from.
fn instructions(text: &mut String, program: &ProgramListing) {
    for line in &program.lines {
        let stage = line.part;
        let _ = match line.origin {
            Some(origin) => {
                let (file, number) = (origin.place.file(), origin.place.line());
                writeln!(text, "\n{:06x}  {stage}, {file}:{number}", line.start)
            }
            None => writeln!(text, "\n{:06x}  {stage}", line.start),
        };
        for instruction in &line.instructions {
            let _ = writeln!(text, "        {instruction}");
        }
    }
}
