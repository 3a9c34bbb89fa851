//! Text for terminals: names and quotes come from files, and codes in them would move the cursor or set colours.

use std::borrow::Cow;
use std::fmt::Write as _;

/// A text whose control characters, but for ends of lines and tabs, are written as `\u001b` is, which JSON reads as well.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_code) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for char in text.chars() {
        match is_code(char) {
            true => {
                write!(shown, "\\u{:04x}", u32::from(char)).expect("a text takes what is written")
            }
            false => shown.push(char),
        }
    }
    Cow::Owned(shown)
}

/// C0 and C1 codes, and those that turn the direction of what follows.
fn is_code(char: char) -> bool {
    let turns = matches!(char, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    turns || (char.is_control() && char != '\n' && char != '\t')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_shown_and_other_text_is_as_it_was() {
        for text in ["a\tb\n", "größer 関節 🤖", "", "\\u001b"] {
            assert!(matches!(printable(text), Cow::Borrowed(same) if same == text));
        }
        let codes = "\u{1b}]0;title\u{7}\r\u{8}\u{7f}\u{9b}31m\u{202e}";
        assert_eq!(
            printable(codes),
            "\\u001b]0;title\\u0007\\u000d\\u0008\\u007f\\u009b31m\\u202e"
        );
        let json = serde_json::to_string("\u{1b}\u{9b}").unwrap();
        let read: String = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read, "\u{1b}\u{9b}");
    }
}
