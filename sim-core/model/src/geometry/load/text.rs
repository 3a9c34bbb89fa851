//! Text of mesh files: its encoding, and its lines.

use std::borrow::Cow;

/// Bytes that are looked at to tell an encoding.
const SAMPLE: usize = 16;
/// What is said of text in UTF-16 or UTF-32.
const WIDE: &str = "it is UTF-16 or UTF-32 text; save it as UTF-8";

/// The text of a file in UTF-8, without its byte order mark; bytes of older encodings become replacement characters.
///
/// # Errors
/// UTF-16 and UTF-32, with the cure.
pub(super) fn text_of(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    unmarked(bytes).map(String::from_utf8_lossy)
}

/// The bytes after a byte order mark of UTF-8.
///
/// # Errors
/// UTF-16 and UTF-32, with the cure.
pub(super) fn unmarked(bytes: &[u8]) -> Result<&[u8], String> {
    let marked = bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff");
    match marked || is_wide(bytes) {
        true => Err(WIDE.to_owned()),
        false => Ok(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)),
    }
}

/// Whether a text of ASCII letters begins in UTF-16 or UTF-32: zeros stand between them.
pub(super) fn is_wide(bytes: &[u8]) -> bool {
    // byte order marks, and a space without width, in either order
    const FIRST: [&[u8]; 8] = [
        b"\xff\xfe\0\0",
        b"\0\0\xfe\xff",
        b"\x0b\x20\0\0",
        b"\0\0\x20\x0b",
        b"\xff\xfe",
        b"\xfe\xff",
        b"\x0b\x20",
        b"\x20\x0b",
    ];
    let unmarked = |bytes| {
        FIRST
            .iter()
            .find_map(|mark| <[u8]>::strip_prefix(bytes, *mark))
    };
    let start = unmarked(bytes).unwrap_or(bytes);
    let start = unmarked(start).unwrap_or(start);
    let start = &start[..start.len().min(SAMPLE) / 4 * 4];
    let letters = |width: usize, place: usize| {
        start.chunks_exact(width).all(|unit| {
            let zeros = unit.iter().filter(|&&byte| byte == 0).count();
            zeros == width - 1 && unit[place] != 0 && unit[place].is_ascii()
        })
    };
    !start.is_empty()
        && [(2, 0), (2, 1), (4, 0), (4, 3)]
            .iter()
            .any(|&(w, p)| letters(w, p))
}

/// Lines of a text, whether they end as on Unix, Windows or the old Macintosh.
///
/// Files that were joined have byte order marks inside, and editors leave spaces without width: at the start of a line they
/// would hide its keyword.
pub(super) fn lines(text: &str) -> impl Iterator<Item = &str> {
    // files that were joined have lines of several systems
    let of_unix = text.split('\n');
    let lines = of_unix.flat_map(|line| line.strip_suffix('\r').unwrap_or(line).split('\r'));
    let hidden = |c: char| matches!(c, '\u{feff}' | '\u{200b}' | '\u{2060}') || c.is_control();
    lines.map(move |line| line.trim_start_matches(hidden))
}
