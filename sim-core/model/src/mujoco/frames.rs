//! Frames of a model for outputs: of bodies, sites and geoms, in MuJoCo's order.

use super::format::ModelFile;
use super::frame;
use super::names::names;
use crate::description::{FrameParts, Inertia, OnLink};
use crate::error::ModelError;

/// Reads the frames of a model with so many bodies.
pub(super) fn frames(file: &ModelFile, bodies: usize) -> Result<FrameParts, ModelError> {
    let masses = file.reals("body_mass", bodies)?;
    let centers = file.vectors::<3>("body_ipos", bodies)?;
    let turns = file.vectors::<4>("body_iquat", bodies)?;
    let moments = file.vectors::<3>("body_inertia", bodies)?;
    let inertias = (0..bodies).map(|body| Inertia {
        mass: masses[body],
        pose: frame(centers[body], turns[body]),
        moments: moments[body],
    });
    Ok(FrameParts {
        inertias: inertias.collect(),
        sites: on_links(file, "site", bodies)?,
        geoms: on_links(file, "geom", bodies)?,
        collisions: vec![None; file.rows("geom_bodyid")],
        site_names: all_names(file, "site")?,
        geom_names: all_names(file, "geom")?,
        // once joints are known
        tendons: Vec::new(),
        tendon_names: Vec::new(),
    })
}

/// Frames of all elements of a kind, `site`, `geom` or `cam`.
pub(super) fn on_links(
    file: &ModelFile,
    kind: &str,
    bodies: usize,
) -> Result<Vec<OnLink>, ModelError> {
    let links = format!("{kind}_bodyid");
    let count = file.rows(&links);
    let links = file.indices(&links, count, bodies)?;
    let places = file.vectors::<3>(&format!("{kind}_pos"), count)?;
    let turns = file.vectors::<4>(&format!("{kind}_quat"), count)?;
    let all = (0..count).map(|k| {
        let link = links[k].ok_or_else(|| file.fault(format!("has a {kind} without a body")))?;
        Ok(OnLink {
            link,
            pose: frame(places[k], turns[k]),
            is_inertial: false,
        })
    });
    all.collect()
}

/// Names of all elements of a kind; files of older versions have none for some kinds.
fn all_names(file: &ModelFile, kind: &str) -> Result<Vec<String>, ModelError> {
    let count = file.rows(&format!("{kind}_bodyid"));
    match file.has(&format!("names.{kind}")) {
        true => names(file, kind, count),
        false => Ok((0..count).map(|k| format!("{kind}{k}")).collect()),
    }
}
