//! What a file says that is allowed and probably not meant: misspelt names, and degrees.

use std::f64::consts::TAU;

/// Most things in a warning.
const LISTED_MAX: usize = 8;
/// Jaro-Winkler similarity of a misspelt name: `orgin`, `dampening` and `multiplicator` have 0.92 or more. What simulators
/// add to URDF has less, or is URDF's name with a word behind it, as `damping_ratio`.
const SIMILAR: f64 = 0.9;
/// An angle above a turn is hardly in radians [rad]; 6.2832 is a turn, rounded.
const ANGLE_USUAL: f64 = TAU + 0.01;
/// Names that other formats have for the same: element, name, and URDF's.
const SYNONYMS: [(&str, &str, &str); 9] = [
    ("limit", "min", "lower"),
    ("limit", "max", "upper"),
    ("limit", "torque", "effort"),
    ("limit", "force", "effort"),
    ("origin", "pos", "xyz"),
    ("origin", "position", "xyz"),
    ("origin", "euler", "rpy"),
    ("origin", "rot", "rpy"),
    ("mimic", "ratio", "multiplier"),
];

/// Likely mistakes of one file.
#[derive(Default)]
pub(super) struct Mistakes {
    misspelt: Vec<String>,
    degrees: Vec<String>,
}

impl Mistakes {
    /// Keeps a name that was ignored and what it was probably meant to be, both as they are written. To count lines takes
    /// time, so that is done for the few that are listed.
    pub fn misspelt(&mut self, what: &str, line: impl FnOnce() -> u32, meant: &str) {
        if self.misspelt.len() <= LISTED_MAX {
            let line = line();
            let text = format!("{what} in line {line}: did you mean {meant}?");
            self.misspelt.push(text);
        }
    }

    /// Keeps angles if they look like degrees; `place` has their element and line.
    pub fn angles(&mut self, rpy: [f64; 3], place: impl FnOnce() -> (String, u32)) {
        let is_beyond = rpy.iter().any(|angle| angle.abs() > ANGLE_USUAL);
        if is_beyond && self.degrees.len() <= LISTED_MAX {
            let ([roll, pitch, yaw], (of, line)) = (rpy, place());
            self.degrees
                .push(format!("{of} in line {line} ({roll} {pitch} {yaw})"));
        }
    }

    /// One warning for each kind.
    pub fn warnings(&self) -> Vec<String> {
        let say = |things: &[String], before: &str, after: &str| {
            let shown = things[..things.len().min(LISTED_MAX)].join(", ");
            let more = if things.len() > LISTED_MAX {
                ", …"
            } else {
                ""
            };
            (!things.is_empty()).then(|| format!("{before}: {shown}{more}{after}"))
        };
        let all = [
            say(
                &self.misspelt,
                "names that URDF does not have are ignored",
                " Mend them in the file",
            ),
            say(
                &self.degrees,
                "rpy turns more than once, so its angles look like degrees",
                "; it counts radians, so divide them by 57.29578 in the file",
            ),
        ];
        all.into_iter().flatten().collect()
    }
}

/// Which of the known names an unknown one in this element was probably meant to be.
pub(super) fn meant(element: &str, name: &str, known: &[&'static str]) -> Option<&'static str> {
    let name = name.to_ascii_lowercase();
    let synonym = SYNONYMS
        .iter()
        .find(|(place, other, _)| *place == element && *other == name);
    if let Some((_, _, standard)) = synonym {
        return known.iter().copied().find(|known| known == standard);
    }
    let likeness = |known: &&str| strsim::jaro_winkler(&name, known);
    let is_longer = |known: &&str| {
        let rest = name.strip_prefix(*known);
        rest.is_some_and(|rest| rest.starts_with(['_', '-']))
    };
    let nearest = known
        .iter()
        .copied()
        .filter(|known| !is_longer(known))
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))?;
    (likeness(&nearest) >= SIMILAR).then_some(nearest)
}
