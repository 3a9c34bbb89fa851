//! Values of an array of a call, world by world.

use sim_protocol::{Command, Values};

/// Worlds of an array that are looked at: such a mistake is in all of them, and thousands would cost microseconds.
const WORLDS: usize = 16;

/// The first worlds of an array that it is for.
pub(crate) fn worlds<'a>(
    of: &Command<'_>,
    mask: Option<&'a [bool]>,
) -> impl Iterator<Item = usize> + 'a {
    let rows = of.values.len() / of.columns.len().max(1);
    (0..rows)
        .filter(move |&world| mask.is_none_or(|mask| mask[world]))
        .take(WORLDS)
}

/// The first value that is wrong, of its first worlds: world, column and value.
pub(crate) fn first(
    of: &Command<'_>,
    mask: Option<&[bool]>,
    is_wrong: impl Fn(usize, f64) -> bool,
) -> Option<(usize, usize, f64)> {
    let width = of.columns.len();
    worlds(of, mask).find_map(|world| {
        let mut values = (0..width).map(|at| (at, number(&of.values, world * width + at)));
        let (at, value) = values.find(|&(at, value)| is_wrong(at, value))?;
        Some((world, at, value))
    })
}

pub(crate) fn number(values: &Values<'_>, at: usize) -> f64 {
    match values {
        Values::F32(values) => f64::from(values[at]),
        Values::F64(values) => values[at],
    }
}
