//! Text in lines of a limited length.

/// Columns of a line that need not be longer.
pub(super) const COLUMNS: usize = 100;

/// Least room for text beside what stands before it, however wide that is.
const ROOM: usize = 40;

/// A space that a line is not broken at; it is printed as any other.
pub(super) const NO_BREAK: &str = "\u{a0}";

/// A text in lines of at most [`COLUMNS`], broken at spaces; the first begins with `first`, others with `next`.
pub(super) fn wrapped(first: &str, next: &str, text: &str) -> String {
    let mut lines = String::new();
    let columns = COLUMNS.max(next.chars().count() + ROOM);
    let mut line = first.to_owned();
    let mut empty = true;
    for word in text.split(' ') {
        let fits = line.chars().count() + 1 + word.chars().count() <= columns;
        if !empty && !fits {
            lines += line.trim_end();
            lines.push('\n');
            line = next.to_owned();
            empty = true;
        }
        if !empty {
            line.push(' ');
        }
        line += word;
        empty = false;
    }
    lines += line.trim_end();
    lines.push('\n');
    lines.replace(NO_BREAK, " ")
}
