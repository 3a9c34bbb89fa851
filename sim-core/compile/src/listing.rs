//! A program for people: its instructions beside the code that they come from.

use crate::allocate::Allocated;
use crate::code::Code;
use crate::x86::Encoded;
use sim_record::{Origin, Recording};
use std::ops::Range;

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

/// Bytes that come from one part of the code.
pub(crate) type PartBytes = (&'static str, Range<usize>);

/// The bytes of a program by what its machine instructions come from: runs that have the same key, in order.
fn runs<K: PartialEq>(
    (recording, code): (&Recording, &Code),
    (allocated, encoded): (&Allocated, &Encoded),
    key: impl Fn(Option<Origin>) -> K,
) -> Vec<(K, Range<usize>)> {
    let end = encoded.bytes.len();
    let mut runs = vec![(key(None), 0..end)];
    for (at, start) in allocated.sources.iter().zip(&encoded.starts) {
        let origin = code.sources[*at as usize].and_then(|value| recording.origin(value));
        let (key, start) = (key(origin), *start as usize);
        match runs.last_mut() {
            Some((last, _)) if *last == key => {}
            Some((_, range)) => {
                range.end = start;
                runs.push((key, start..end));
            }
            None => unreachable!("a program begins with a run"),
        }
    }
    // labels have no bytes
    runs.retain(|(_, range)| !range.is_empty());
    runs
}

/// The bytes of a program by parts of the code.
pub(crate) fn parts(recorded: (&Recording, &Code), made: (&Allocated, &Encoded)) -> Vec<PartBytes> {
    runs(recorded, made, part)
}

/// The lines of a program whose instructions were asked for.
pub(crate) fn lines(recorded: (&Recording, &Code), made: (&Allocated, &Encoded)) -> Vec<Line> {
    let (_, encoded) = made;
    let mut rest = encoded.listing.iter().peekable();
    let line = |(origin, range): (Option<Origin>, Range<usize>)| {
        let mut instructions = Vec::new();
        while let Some((_, text)) = rest.next_if(|(start, _)| (*start as usize) < range.end) {
            instructions.push(text.clone());
        }
        Line {
            part: part(origin),
            origin,
            start: range.start,
            bytes: range.len(),
            instructions,
        }
    };
    runs(recorded, made, |origin| origin)
        .into_iter()
        .map(line)
        .collect()
}
