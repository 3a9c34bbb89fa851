//! Values of attributes: read as what the table asks for, or refused with the cure.

use std::borrow::Cow;

use super::table::{Attribute, Kind, Need, Sign};
use super::xml::short;
use crate::value_checks::NAME_MAX;

/// Longest path [bytes], as on Linux.
const PATH_MAX: usize = 4096;
/// Largest angle [rad]: of a larger one, less than ten digits would remain.
const ANGLE_MAX: f64 = 1e6;

/// A value that its attribute may have.
pub(super) struct Value<'a> {
    /// The value as it is written, with one space between numbers.
    pub text: Cow<'a, str>,
    /// The numbers, as many as the attribute has; then zeros.
    pub numbers: [f64; 4],
    /// Whether commas between the numbers were ignored.
    pub commas: bool,
}

/// Reads a value as what its attribute asks for.
///
/// # Errors
/// What is wrong with it, and the cure.
pub(super) fn read<'a>(attribute: &Attribute, value: &'a str) -> Result<Value<'a>, String> {
    let name = attribute.name;
    if value.contains("${") || value.contains("$(") {
        let value = short(value);
        return Err(format!(
            "attribute `{name}` is \"{value}\", left from xacro; run `xacro` on the file and load what it prints"
        ));
    }
    let as_it_is = |most: usize| {
        if value.trim().is_empty() && attribute.need == Need::Required {
            return Err(format!("attribute `{name}` is empty; fill it in"));
        }
        if value.contains(char::is_control) {
            let value = short(value);
            return Err(format!(
                "attribute `{name}` is \"{value}\", with a control character; delete it"
            ));
        }
        if value.len() > most {
            let (short, bytes) = (short(value), value.len());
            return Err(format!(
                "attribute `{name}` is \"{short}\", {bytes} bytes long; use at most {most}"
            ));
        }
        Ok(Value {
            text: Cow::Borrowed(value),
            numbers: [0.0; 4],
            commas: false,
        })
    };
    match attribute.kind {
        Kind::Name => as_it_is(NAME_MAX),
        Kind::Path => as_it_is(PATH_MAX),
        Kind::Number | Kind::Limit => numbers(attribute, value, 1, "one number"),
        Kind::Vector | Kind::Angles => {
            numbers(attribute, value, 3, "three numbers separated by spaces")
        }
        Kind::Quaternion => numbers(attribute, value, 4, "four numbers separated by spaces"),
    }
}

fn numbers<'a>(
    attribute: &Attribute,
    value: &'a str,
    count: usize,
    shape: &str,
) -> Result<Value<'a>, String> {
    let refuse = |what: &str, cure: &str| {
        let value = short(value);
        Err(format!(
            "attribute `{}` is \"{value}\", {what}; {cure}",
            attribute.name
        ))
    };
    let mut commas = false;
    let mut parts: Vec<&str> = Vec::with_capacity(count);
    for part in value.split_ascii_whitespace() {
        if parts.len() > count {
            break;
        }
        // `1, 2, 3` is three numbers; `0,5` may be one number or two
        let bare = part.strip_suffix(',').filter(|_| count > 1);
        commas |= bare.is_some();
        parts.push(bare.unwrap_or(part));
    }
    let mut parsed = Vec::with_capacity(count);
    for part in &parts {
        let is_digits = part.contains(|c: char| c.is_ascii_digit());
        match part.parse::<f64>() {
            Ok(number) if number.is_nan() => {
                return refuse("which is not a number", &format!("give {shape}"));
            }
            Ok(number) if number.is_infinite() && is_digits => {
                return refuse("beyond what a number can hold", "give a smaller one");
            }
            Ok(number) if number.is_infinite() && attribute.kind != Kind::Limit => {
                return refuse("which is not finite", &format!("give {shape}"));
            }
            Ok(number) => parsed.push(number),
            Err(_) if is_digits && part.contains(',') => {
                return refuse(
                    "with a comma inside a number",
                    "write decimals with a point",
                );
            }
            Err(_) => {
                let what = format!("where `{}` is not a number", short(part));
                let what = if parts.len() == 1 {
                    "which is not a number"
                } else {
                    &what
                };
                return refuse(what, &format!("give {shape}, without units"));
            }
        }
    }
    match (parsed.len(), count) {
        (given, count) if given == count => {}
        (0, _) => {
            let name = attribute.name;
            return Err(format!(
                "attribute `{name}` is empty; give {shape}{}",
                match attribute.need {
                    Need::Required => "",
                    _ => ", or delete it",
                }
            ));
        }
        (given, count) if given > count => {
            return refuse("too many numbers", &format!("give {shape}"));
        }
        (given, _) => {
            let plural = if given == 1 { "" } else { "s" };
            return refuse(
                &format!("only {given} number{plural}"),
                &format!("give {shape}"),
            );
        }
    }
    match attribute.sign {
        Sign::Positive if parsed.iter().any(|&number| number <= 0.0) => {
            return refuse("but sizes are above 0", &format!("give {shape} above 0"));
        }
        Sign::NotNegative if parsed.iter().any(|&number| number < 0.0) => {
            return refuse("which is negative", "give 0 or more");
        }
        _ => {}
    }
    if attribute.kind == Kind::Angles && parsed.iter().any(|angle| angle.abs() > ANGLE_MAX) {
        return refuse("more than 1e6 rad", "give angles within a turn or two");
    }
    let mut numbers = [0.0; 4];
    numbers[..count].copy_from_slice(&parsed);
    let text = match parts[..] {
        [only] => Cow::Borrowed(only),
        _ => Cow::Owned(parts.join(" ")),
    };
    Ok(Value {
        text,
        numbers,
        commas,
    })
}

/// Roll, pitch and yaw [rad] of a quaternion (x, y, z, w) of any length but 0, exact to rounding at every pitch.
/// urdf-rs' own conversion is not, near a pitch of 90°.
///
/// With half angles φ, θ, ψ of q = q_z(2ψ) q_y(2θ) q_x(2φ):
///
///     w + y = (cos θ + sin θ) cos(φ − ψ)      x − z = (cos θ + sin θ) sin(φ − ψ)
///     w − y = (cos θ − sin θ) cos(φ + ψ)      x + z = (cos θ − sin θ) sin(φ + ψ)
pub(super) fn rpy_of_quat([x, y, z, w]: [f64; 4]) -> Option<[f64; 3]> {
    let largest = [x, y, z, w]
        .iter()
        .fold(0.0_f64, |m, part| m.max(part.abs()));
    if largest == 0.0 {
        return None;
    }
    let [x, y, z, w] = [x, y, z, w].map(|part| part / largest);
    let difference = libm::atan2(x - z, w + y);
    let sum = libm::atan2(x + z, w - y);
    let ratio = libm::atan2(libm::hypot(x + z, w - y), libm::hypot(x - z, w + y));
    let pitch = std::f64::consts::FRAC_PI_2 - 2.0 * ratio;
    Some([sum + difference, pitch, sum - difference])
}
