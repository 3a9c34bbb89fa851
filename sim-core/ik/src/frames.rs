//! Frames by name: links, sites, and the sites of MuJoCo models.

use crate::error::IkError;
use sim_model::Model;
use sim_physics::constants::site::Mount;
use sim_physics::math::quat;

/// Most names in a message.
const SHOWN: usize = 12;

/// The frame of a link or site. A link has precedence over a site of its name.
///
/// # Errors
/// [`IkError::Frame`]
pub fn frame(model: &Model, name: &str) -> Result<Mount<f64>, IkError> {
    let m = model.constants();
    let at = |names: &[String]| names.iter().position(|known| known == name);
    if let Some(link) = at(model.body_names()) {
        let frame = &m.frames[link];
        return Ok(Mount {
            body: frame.body,
            tree: Some(frame.tree),
            position: frame.position,
            quat: frame.quat,
            rotation: quat::matrix(frame.quat).0.map(|column| column.0),
        });
    }
    if let Some(site) = at(model.site_names()) {
        return Ok(m.sites[site].mount.clone());
    }
    if let Some(site) = at(model.output_site_names()) {
        return Ok(m.outputs.sites[site].clone());
    }
    let names = frame_names(model);
    let more = if names.len() > SHOWN { ", …" } else { "" };
    Err(IkError::Frame {
        name: name.to_owned(),
        known: names[..names.len().min(SHOWN)].join(", ") + more,
    })
}

/// Names of all frames: links, sites, and sites of MuJoCo models.
pub fn frame_names(model: &Model) -> Vec<String> {
    let names = model.body_names().iter().chain(model.site_names());
    names.chain(model.output_site_names()).cloned().collect()
}
