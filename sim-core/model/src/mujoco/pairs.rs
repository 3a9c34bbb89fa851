//! Pairs of geoms that touch by rules of their own (MuJoCo: `contact/pair`).

use super::format::ModelFile;
use super::names::names;
use super::options::has_flag;
use super::refusals::{no, refuse_power};
use super::tree::softness;
use crate::description::{ContactPair, Robot};
use crate::error::ModelError;
use crate::geom_contact::GeomContact;

/// The geoms of each pair, the lower one first.
fn geoms(file: &ModelFile, geoms: usize) -> Result<Vec<[usize; 2]>, ModelError> {
    let count = file.rows("pair_dim");
    if count == 0 {
        return Ok(Vec::new());
    }
    let firsts = file.indices("pair_geom1", count, geoms)?;
    let seconds = file.indices("pair_geom2", count, geoms)?;
    let both = firsts.into_iter().zip(seconds).map(|both| match both {
        (Some(first), Some(second)) => Ok([first.min(second), first.max(second)]),
        _ => Err(file.fault("has a pair without its geoms".to_owned())),
    });
    both.collect()
}

/// Which geoms are in a pair.
pub(super) fn paired(file: &ModelFile, count: usize) -> Result<Vec<bool>, ModelError> {
    let mut paired = vec![false; count];
    for geom in geoms(file, count)?.into_iter().flatten() {
        paired[geom] = true;
    }
    Ok(paired)
}

/// Adds the pairs. `places` are the links of geoms, and their places among the links' shapes; empty without contacts.
pub(super) fn add_pairs(
    file: &ModelFile,
    places: &[Option<(usize, usize)>],
    robot: &mut Robot,
) -> Result<(), ModelError> {
    let pairs = geoms(file, file.rows("geom_type"))?;
    let Some(parts) = robot.precompiled.as_mut().filter(|_| !places.is_empty()) else {
        return Ok(());
    };
    if pairs.is_empty() {
        return Ok(());
    }
    let count = pairs.len();
    let names = names(file, "pair", count)?;
    let condims = file.integers("pair_dim", count)?;
    let softness = softness(file, "pair", count)?;
    let sliding = file.vectors::<2>("pair_solreffriction", count)?;
    let frictions = file.vectors::<5>("pair_friction", count)?;
    let margins = file.reals("pair_margin", count)?;
    let gaps = file.reals("pair_gap", count)?;
    let adhesions = file.reals_or("pair_adhesion", count, 0.0)?;
    for (k, geoms) in pairs.into_iter().enumerate() {
        let [Some(first), Some(second)] = geoms.map(|geom| places[geom]) else {
            return Err(file.fault("has a pair without its geoms".to_owned()));
        };
        let [slide, across, twist, roll, roll_across] = frictions[k];
        parts.pairs.push(ContactPair {
            name: names[k].clone(),
            geoms: [first, second],
            contact: GeomContact {
                contype: 1,
                conaffinity: 1,
                condim: usize::try_from(condims[k]).unwrap_or(3),
                priority: 0,
                solmix: 1.0,
                softness: softness[k],
                friction: [slide, twist, roll],
                margin: margins[k],
                gap: gaps[k],
                surface_velocity: [0.0; 6],
                adhesion: adhesions[k],
            },
            second: [across, roll_across],
            sliding: (sliding[k] != [0.0; 2]).then_some(sliding[k]),
        });
    }
    Ok(())
}

/// Pairs that contacts of ours cannot express.
pub(super) fn refuse(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let pairs = geoms(file, file.rows("geom_type"))?;
    let is_off = has_flag(file, "mjDSBL_CONTACT")? || has_flag(file, "mjDSBL_CONSTRAINT")?;
    if pairs.is_empty() || is_off {
        return Ok(());
    }
    let count = pairs.len();
    let names = names(file, "pair", count)?;
    let condims = file.integers("pair_dim", count)?;
    let solimps = file.vectors::<5>("pair_solimp", count)?;
    for k in 0..count {
        let name = &names[k];
        let wrong = [
            (
                !matches!(condims[k], 1 | 3 | 4 | 6),
                "a condim other than 1, 3, 4 and 6",
            ),
            (
                pairs[..k].contains(&pairs[k]),
                "a second pair of the same geoms",
            ),
        ];
        let wrong = wrong.iter().filter(|(is_wrong, _)| *is_wrong);
        refused.extend(wrong.map(|(_, what)| no("pair", name, what)));
        refuse_power(refused, "pair", name, &solimps[k]);
    }
    Ok(())
}
