//! Springs that yield, and keyframes that say how far they did.

use super::format::ModelFile;
use super::names::names;
use super::refusals::no;
use crate::error::ModelError;

/// The stretch beyond which the spring of each joint (`jnt`) or `tendon` yields; none where it never does. Versions of MuJoCo
/// before 4.0 have no such springs.
pub(super) fn yields(
    file: &ModelFile,
    kind: &str,
    count: usize,
) -> Result<Vec<Option<f64>>, ModelError> {
    let places = places(file, kind, count)?;
    let bounds = file.reals_or(&format!("{kind}_springyield"), count, 0.0)?;
    let both = places.into_iter().zip(bounds);
    // MuJoCo chose at compilation which ones yield, so that a bound of 0 is none that was left out
    Ok(both
        .map(|(place, bound)| place.and(Some(bound.max(0.0)).filter(|bound| bound.is_finite())))
        .collect())
}

/// First places of rests in MuJoCo's plastic state.
fn places(file: &ModelFile, kind: &str, count: usize) -> Result<Vec<Option<usize>>, ModelError> {
    let places = file.integers_or(&format!("{kind}_plasticadr"), count, -1)?;
    Ok(places
        .into_iter()
        .map(|x| usize::try_from(x).ok())
        .collect())
}

/// Refuses free joints that yield, and keyframes in which springs have yielded: a keyframe sets no rests here.
pub(super) fn refuse(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let (joints, tendons) = (file.rows("jnt_type"), file.rows("tendon_num"));
    let kinds = file.kinds("jnt_type", joints)?;
    let joint_names = names(file, "joint", joints)?;
    let coords = file.rows("qpos0");
    let firsts = file.indices("jnt_qposadr", joints, coords)?;
    let joint_rests = file.reals("qpos_spring", coords)?;
    // MuJoCo's plastic state before any spring yields
    let mut starts = Vec::new();
    for (joint, place) in places(file, "jnt", joints)?.into_iter().enumerate() {
        let Some(place) = place else { continue };
        let width = match kinds[joint].as_str() {
            "mjJNT_SLIDE" | "mjJNT_HINGE" => 1,
            "mjJNT_BALL" => 4,
            _ => {
                let what = "a plastic spring of a free joint";
                refused.push(no("joint", &joint_names[joint], what));
                continue;
            }
        };
        let rests = joint_rests.iter().skip(firsts[joint].unwrap_or(coords));
        starts.extend((place..).zip(rests.take(width).copied()));
    }
    let lengths = file.vectors::<2>("tendon_lengthspring", tendons)?;
    for (place, rests) in places(file, "tendon", tendons)?.into_iter().zip(lengths) {
        starts.extend(place.into_iter().flat_map(|place| (place..).zip(rests)));
    }
    let keys = file.rows("key_time");
    if starts.is_empty() || keys == 0 || !file.has("key_plastic") {
        return Ok(());
    }
    let key_names = names(file, "key", keys)?;
    let width = file.columns("key_plastic");
    if starts.iter().any(|(place, _)| *place >= width) {
        return Err(file.fault("has keyframes without rests of plastic springs".to_owned()));
    }
    let rests = file.reals("key_plastic", keys * width)?;
    for (name, rests) in key_names.iter().zip(rests.chunks_exact(width)) {
        if starts.iter().any(|&(place, start)| rests[place] != start) {
            refused.push(no("key", name, "rests of plastic springs in a keyframe"));
        }
    }
    Ok(())
}
