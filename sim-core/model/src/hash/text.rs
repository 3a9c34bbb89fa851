//! The text that a model's hash is of: values under keys that the files beside this one name.

use std::fmt::{Debug, Write};

/// FNV-1a of a text, computed while the text is written.
pub(super) struct Text {
    hash: u64,
}

/// When a group of values is part of the text.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum When {
    /// In every model.
    Always,
    /// Where one of the values is present. For what later releases added: models without it keep their hash.
    Later,
    /// In none: it follows from the rest, and no recording depends on it.
    Never,
}

/// Values with their keys, and when they are part of the text.
pub(super) type Group<'a> = (When, &'a [(&'a str, &'a dyn View)]);

/// A value as the hash has it.
pub(super) trait View {
    /// Writes it.
    fn write(&self, text: &mut Text);

    /// Whether it is what models have that do without it.
    fn is_absent(&self) -> bool {
        false
    }
}

impl Text {
    pub(super) fn new() -> Text {
        Text {
            hash: 0xcbf2_9ce4_8422_2325,
        }
    }

    pub(super) fn hash(&self) -> u64 {
        self.hash
    }

    /// Writes words.
    pub(super) fn put(&mut self, words: &str) {
        self.hash = words.bytes().fold(self.hash, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
    }

    /// Writes a number or a string as Rust spells it.
    pub(super) fn spell(&mut self, value: impl Debug) {
        let spelled = write!(self, "{value:?}");
        spelled.expect("a hash takes every text");
    }

    /// Writes values between two ends.
    fn listed<'a>(&mut self, ends: [&str; 2], values: impl Iterator<Item = &'a dyn View>) {
        self.put(ends[0]);
        for (place, value) in values.enumerate() {
            self.put(if place > 0 { ", " } else { "" });
            value.write(self);
        }
        self.put(ends[1]);
    }

    /// Writes a name and values without keys.
    pub(super) fn tuple(&mut self, name: &str, values: &[&dyn View]) {
        self.put(name);
        self.listed(["(", ")"], values.iter().copied());
    }

    /// Writes a name and values with keys.
    pub(super) fn groups(&mut self, name: &str, groups: &[Group<'_>]) {
        self.put(name);
        let is_shown = |(when, values): &&Group<'_>| match when {
            When::Always => true,
            When::Later => !values.iter().all(|(_, value)| value.is_absent()),
            When::Never => false,
        };
        let mut separator = " { ";
        for (key, value) in groups
            .iter()
            .filter(is_shown)
            .flat_map(|(_, values)| *values)
        {
            self.put(separator);
            self.put(key);
            self.put(": ");
            value.write(self);
            separator = ", ";
        }
        self.put(" }");
    }
}

impl Write for Text {
    fn write_str(&mut self, words: &str) -> std::fmt::Result {
        self.put(words);
        Ok(())
    }
}

/// Views of structs: the name and the keys that the hash has for it, whatever the code calls them.
///
/// A field that is missing here is a compile error: what is new gets `Later`, so that recordings of models without it stay
/// readable. A field that was renamed keeps its key. Fields after `=>` are written by another view.
macro_rules! view {
    ($($type:ty as $name:literal: $($when:ident { $($key:literal: $field:ident),* $(,)? })* $(=> $($other:ident),*)?;)*) => {$(
        impl $crate::hash::text::View for $type {
            fn write(&self, text: &mut $crate::hash::text::Text) {
                let Self { $($($field,)*)* $($($other: _,)*)? } = self;
                text.groups($name, &[$(
                    ($crate::hash::text::When::$when, &[$(($key, $field as &dyn $crate::hash::text::View)),*]),
                )*]);
            }

            fn is_absent(&self) -> bool {
                let Self { $($($field,)*)* $($($other: _,)*)? } = self;
                true $($(&& $crate::hash::text::View::is_absent($field))*)*
            }
        }
    )*};
}
pub(super) use view;

/// Views of enums without values, by words that the hash has for their variants; the first is what models have that do
/// without it.
macro_rules! words {
    ($($type:ident: $first:ident $first_word:literal $(, $variant:ident $word:literal)*;)*) => {$(
        impl $crate::hash::text::View for $type {
            fn write(&self, text: &mut $crate::hash::text::Text) {
                text.put(match self {
                    $type::$first => $first_word,
                    $($type::$variant => $word,)*
                });
            }

            fn is_absent(&self) -> bool {
                matches!(self, $type::$first)
            }
        }
    )*};
}
pub(super) use words;

impl<T: View + ?Sized> View for &T {
    fn write(&self, text: &mut Text) {
        (**self).write(text);
    }

    fn is_absent(&self) -> bool {
        (**self).is_absent()
    }
}

impl View for f64 {
    fn write(&self, text: &mut Text) {
        text.spell(self);
    }

    fn is_absent(&self) -> bool {
        self.to_bits() == 0
    }
}

impl View for usize {
    fn write(&self, text: &mut Text) {
        text.spell(self);
    }

    fn is_absent(&self) -> bool {
        *self == 0
    }
}

impl View for u32 {
    fn write(&self, text: &mut Text) {
        text.spell(self);
    }
}

impl View for bool {
    fn write(&self, text: &mut Text) {
        text.spell(self);
    }

    fn is_absent(&self) -> bool {
        !self
    }
}

impl View for String {
    fn write(&self, text: &mut Text) {
        text.spell(self);
    }
}

impl<T: View> View for Vec<T> {
    fn write(&self, text: &mut Text) {
        text.listed(["[", "]"], self.iter().map(|value| value as &dyn View));
    }

    fn is_absent(&self) -> bool {
        self.is_empty()
    }
}

impl<T: View, const N: usize> View for [T; N] {
    fn write(&self, text: &mut Text) {
        text.listed(["[", "]"], self.iter().map(|value| value as &dyn View));
    }

    fn is_absent(&self) -> bool {
        self.iter().all(View::is_absent)
    }
}

impl<T: View> View for Option<T> {
    fn write(&self, text: &mut Text) {
        match self {
            None => text.put("None"),
            Some(value) => text.tuple("Some", &[value]),
        }
    }

    fn is_absent(&self) -> bool {
        self.is_none()
    }
}

impl<A: View, B: View> View for (A, B) {
    fn write(&self, text: &mut Text) {
        text.tuple("", &[&self.0, &self.1]);
    }
}
