//! A program for people: its instructions beside the code that they come from.

use crate::allocate::Allocated;
use crate::code::Code;
use crate::x86::Encoded;
use sim_record::{Origin, Recording};

/// The part of a program that begins and ends it, and what was not computed by the code itself.
const EDGES: &str = "entry and exit";

/// The name of the part that an origin is in.
fn part(origin: Option<Origin>) -> &'static str {
    match origin.map(|origin| origin.part) {
        None | Some("") => EDGES,
        Some(part) => part,
    }
}

/// Instructions that come from one operation of the code.
#[derive(Clone, Debug)]
pub struct Line {
    /// The part of the code that it belongs to, such as a stage.
    pub part: &'static str,
    /// Where from; none for what begins and ends a program.
    pub origin: Option<Origin>,
    /// Bytes from the program's first to this.
    pub start: usize,
    /// How many bytes it has.
    pub bytes: usize,
    /// The instructions, in the syntax of Intel's manuals.
    pub instructions: Vec<String>,
}

/// A run of bytes that come from one part of the code.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartBytes {
    pub part: &'static str,
    pub start: usize,
    pub bytes: usize,
}

/// The origin of each machine instruction.
fn origins<'a>(
    recording: &'a Recording,
    code: &'a Code,
    allocated: &'a Allocated,
) -> impl Iterator<Item = Option<Origin>> + 'a {
    let sources = allocated.sources.iter();
    sources.map(|at| recording.origin(code.sources[*at as usize]?))
}

/// The bytes of a program by parts of the code.
pub(crate) fn parts(
    recording: &Recording,
    code: &Code,
    allocated: &Allocated,
    encoded: &Encoded,
) -> Vec<PartBytes> {
    let mut parts: Vec<PartBytes> = Vec::new();
    let begins = |part: &'static str, start: usize| PartBytes {
        part,
        start,
        bytes: 0,
    };
    let mut open = begins(EDGES, 0);
    let starts = encoded.starts.iter().map(|start| *start as usize);
    for (origin, start) in origins(recording, code, allocated).zip(starts) {
        let part = part(origin);
        if part != open.part {
            open.bytes = start - open.start;
            parts.push(open);
            open = begins(part, start);
        }
    }
    open.bytes = encoded.bytes.len() - open.start;
    parts.push(open);
    parts
}

/// The lines of a program whose instructions were asked for.
pub(crate) fn lines(
    recording: &Recording,
    code: &Code,
    allocated: &Allocated,
    encoded: &Encoded,
) -> Vec<Line> {
    let begins = |origin: Option<Origin>, start: usize| Line {
        part: part(origin),
        origin,
        start,
        bytes: 0,
        instructions: Vec::new(),
    };
    let mut lines = vec![begins(None, 0)];
    let mut places = origins(recording, code, allocated)
        .zip(&encoded.starts)
        .peekable();
    let mut origin = None;
    for (start, instruction) in &encoded.listing {
        while let Some((next, _)) = places.next_if(|(_, from)| *from <= start) {
            origin = next;
        }
        let start = *start as usize;
        if lines.last().is_none_or(|line| line.origin != origin) {
            lines.push(begins(origin, start));
        }
        if let Some(line) = lines.last_mut() {
            line.instructions.push(instruction.clone());
        }
    }
    let ends: Vec<usize> = (lines.iter().skip(1).map(|line| line.start))
        .chain([encoded.bytes.len()])
        .collect();
    for (line, end) in lines.iter_mut().zip(ends) {
        line.bytes = end - line.start;
    }
    lines
}
