//! Names of elements. An element without a name has its kind and number.

use super::format::ModelFile;
use crate::error::ModelError;

/// Names of all elements of a kind, `body`, `joint`, `geom`, `actuator`, …; `count` of them.
pub(super) fn names(file: &ModelFile, kind: &str, count: usize) -> Result<Vec<String>, ModelError> {
    let found = file.texts(&format!("names.{kind}"))?;
    if found.len() != count {
        return Err(file.fault(format!(
            "has {} names of kind `{kind}` instead of {count}",
            found.len()
        )));
    }
    let taken: std::collections::HashSet<String> = found.iter().cloned().collect();
    let named = found.into_iter().enumerate().map(|(index, name)| {
        if !name.is_empty() {
            return name;
        }
        let mut free = std::iter::once(format!("{kind}{index}"))
            .chain((2..).map(|again| format!("{kind}{index}_{again}")));
        free.find(|name| !taken.contains(name))
            .expect("there are more numbers than names")
    });
    Ok(named.collect())
}
