//! Checks of one name or one value, each refused with its owner and the cure.

use std::collections::HashSet;

use crate::error::ModelError;

/// Longest name [bytes].
pub(crate) const NAME_MAX: usize = 256;

/// Refuses a name that is empty or too long, or has a control character.
pub(crate) fn name(what: &'static str, name: &str) -> Result<(), ModelError> {
    let rule = if name.trim().is_empty() || name.chars().any(char::is_control) {
        "it must be of printable characters; give it one or more"
    } else if name.len() > NAME_MAX {
        "give it at most 256 bytes"
    } else {
        return Ok(());
    };
    let shown: String = name
        .chars()
        .take(NAME_MAX)
        .flat_map(char::escape_debug)
        .collect();
    Err(ModelError::BadName {
        what,
        name: shown,
        rule,
    })
}

/// Refuses a name that comes twice, with the index of the second.
pub(crate) fn unique<'a>(
    owner: &str,
    what: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), (usize, ModelError)> {
    let mut seen = HashSet::new();
    for (index, name) in names.enumerate() {
        if !seen.insert(name) {
            let error = ModelError::DuplicateName {
                owner: owner.to_owned(),
                what,
                name: name.to_owned(),
            };
            return Err((index, error));
        }
    }
    Ok(())
}

/// Refuses a count outside 1 to `most`.
pub(crate) fn count(
    what: &str,
    value: usize,
    most: usize,
    rule: &'static str,
) -> Result<(), ModelError> {
    in_range(what, value as f64, (1..=most).contains(&value), rule)
}

/// Refuses a number that is not finite.
pub(crate) fn finite(what: &str, value: f64) -> Result<(), ModelError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ModelError::NotFinite {
            what: what.to_owned(),
            value,
        })
    }
}

/// Refuses a number that is negative or not finite.
pub(crate) fn not_negative(what: &str, value: f64) -> Result<(), ModelError> {
    in_range(what, value, value >= 0.0, "it must not be negative")
}

/// Refuses a number that is 0, negative or not finite.
pub(crate) fn positive(what: &str, value: f64) -> Result<(), ModelError> {
    in_range(what, value, value > 0.0, "it must be above 0")
}

/// Refuses a number that is not finite, or for which `holds` is false.
pub(crate) fn in_range(
    what: &str,
    value: f64,
    holds: bool,
    rule: &'static str,
) -> Result<(), ModelError> {
    finite(what, value)?;
    if holds {
        Ok(())
    } else {
        Err(ModelError::OutOfRange {
            what: what.to_owned(),
            value,
            rule,
        })
    }
}

/// Refuses a number that is not finite, or larger than `most` to either side.
pub(crate) fn within(
    what: &str,
    value: f64,
    most: f64,
    rule: &'static str,
) -> Result<(), ModelError> {
    in_range(what, value, value.abs() <= most, rule)
}
