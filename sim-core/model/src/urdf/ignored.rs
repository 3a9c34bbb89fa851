//! Notes of what has no effect in a file: each thing once, with its count and its first line.

use std::collections::HashMap;

/// Most notes of ignored things: more than a person reads.
const NOTES_MAX: usize = 200;

/// What was ignored.
#[derive(Default)]
pub(super) struct Ignored {
    things: Vec<Thing>,
    /// Place in `things`, by what it is.
    index: HashMap<String, usize>,
    /// How often something was ignored that got no note of its own.
    more: usize,
}

struct Thing {
    what: String,
    count: usize,
    /// Where it was met first, from the start of the text [bytes].
    at: usize,
}

impl Ignored {
    /// Notes a thing that was met at `at` [bytes]; the same thing again is only counted.
    pub fn add(&mut self, what: String, at: usize) {
        if let Some(&index) = self.index.get(&what) {
            self.things[index].count += 1;
        } else if self.things.len() < NOTES_MAX {
            self.index.insert(what.clone(), self.things.len());
            self.things.push(Thing { what, count: 1, at });
        } else {
            self.more += 1;
        }
    }

    /// One sentence for each thing, in the order in which they were met in `text`.
    pub fn notes(&self, text: &str) -> Vec<String> {
        let lines = lines(text, self.things.iter().map(|thing| thing.at).collect());
        let mut notes: Vec<String> = Vec::new();
        for (Thing { what, count, .. }, line) in self.things.iter().zip(lines) {
            notes.push(match count {
                1 => format!("{what} is ignored (line {line})"),
                _ => format!("{what} is ignored ({count} times, first in line {line})"),
            });
        }
        if self.more > 0 {
            notes.push(format!(
                "{} further unknown elements and attributes are ignored",
                self.more
            ));
        }
        notes
    }
}

/// The line of each of these places [bytes], in one pass over the text.
fn lines(text: &str, places: Vec<usize>) -> Vec<usize> {
    let text = text.as_bytes();
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by_key(|&index| places[index]);
    let mut lines = vec![0; places.len()];
    let (mut line, mut from) = (1, 0);
    for index in order {
        let passed = &text[from..places[index]];
        line += passed.iter().filter(|&&byte| byte == b'\n').count();
        from = places[index];
        lines[index] = line;
    }
    lines
}
