//! Names of elements. An element without a name has its kind and number.

use super::format::ModelFile;
use crate::error::ModelError;

/// Names of all elements of a kind, `body`, `joint`, `geom`, `actuator`, …; `count` of them.
pub(super) fn names(file: &ModelFile, kind: &str, count: usize) -> Result<Vec<String>, ModelError> {
    let texts = file.texts(&format!("names.{kind}"))?;
    if texts.len() != count {
        return Err(file.fault(format!(
            "has {} names of kind `{kind}` instead of {count}",
            texts.len()
        )));
    }
    let taken: std::collections::HashSet<String> = texts.iter().cloned().collect();
    let named = texts.into_iter().enumerate().map(|(index, name)| {
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
