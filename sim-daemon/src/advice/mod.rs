//! What is valid in a scene and most likely a mistake: reported once, when a daemon starts, with the cure.

mod draws;
mod drives;
mod factors;
mod followers;
mod friction;
mod gravity;
mod grounds;
mod robots;
mod start;
mod values;

use std::sync::Arc;

use sim_model::{Description, Model};

/// Names in a list before the others are only counted.
const NAMED: usize = 3;

/// Advice on a scene and its model, a sentence or two each.
pub(crate) fn advice(scene: &Description, model: &Arc<Model>) -> Vec<String> {
    let mut all = values::advice(scene);
    all.extend(robots::advice(scene));
    all.extend(followers::advice(scene));
    all.extend(grounds::advice(scene));
    all.extend(drives::swinging(scene, model));
    all.extend(drives::unstable(scene, model));
    all.extend(factors::advice(scene, model));
    all.extend(friction::advice(scene, model));
    all.extend(start::advice(scene, model));
    all
}

/// The first names, and how many more there are.
fn some(names: &[String]) -> String {
    let named = names[..names.len().min(NAMED)].join(", ");
    match names.len() - names.len().min(NAMED) {
        0 => named,
        more => format!("{named} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::some;

    #[test]
    fn long_lists_end_with_a_count() {
        let names: Vec<String> = ["a", "b", "c", "d", "e"].map(str::to_owned).to_vec();
        assert_eq!(some(&names[..3]), "a, b, c");
        assert_eq!(some(&names), "a, b, c and 2 more");
    }
}
