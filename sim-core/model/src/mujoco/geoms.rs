//! Geoms of a model as shapes of links. Geoms that touch nothing are left to pictures.

use super::fields::height_field;
use super::format::ModelFile;
use super::frame;
use super::meshes::Meshes;
use super::names::names;
use super::options::{MujocoOptions, has_flag};
use super::pairs::paired;
use super::tree::softness;
use crate::description::{Collision, Robot, Shape};
use crate::error::ModelError;
use crate::geom_contact::GeomContact;
use crate::surface::Surface;
use std::sync::Arc;

/// Adds the geoms that may touch something. Returns of each geom its link, and its place among the link's shapes.
pub(super) fn add_geoms(
    file: &ModelFile,
    options: &MujocoOptions,
    robot: &mut Robot,
) -> Result<Vec<Option<(usize, usize)>>, ModelError> {
    if has_flag(file, "mjDSBL_CONTACT")? || has_flag(file, "mjDSBL_CONSTRAINT")? {
        return Ok(Vec::new());
    }
    let count = file.rows("geom_type");
    let paired = paired(file, count)?;
    let mut all = vec![None; count];
    let geom_names = names(file, "geom", count)?;
    let kinds = file.kinds("geom_type", count)?;
    let bodies = file.indices("geom_bodyid", count, robot.links.len())?;
    let places = file.vectors::<3>("geom_pos", count)?;
    let turns = file.vectors::<4>("geom_quat", count)?;
    let sizes = file.vectors::<3>("geom_size", count)?;
    let contacts = contacts(file, count)?;
    let meshes = file.integers("geom_dataid", count)?;
    let all_meshes = Meshes::read(file)?;
    let mut known: Vec<(i64, Shape)> = Vec::new();
    for geom in 0..count {
        let contact = contacts[geom];
        if contact.contype == 0 && contact.conaffinity == 0 && !paired[geom] {
            continue;
        }
        let shape = match (kinds[geom].as_str(), primitive(&kinds[geom], sizes[geom])) {
            (_, Some(shape)) => shape,
            ("mjGEOM_PLANE", _) => Shape::Plane,
            ("mjGEOM_HFIELD", _) => Shape::HeightField(Arc::new(height_field(file, meshes[geom])?)),
            ("mjGEOM_MESH", _) => {
                let mesh = meshes[geom];
                match known.iter().find(|(other, _)| *other == mesh) {
                    Some((_, shape)) => shape.clone(),
                    None => {
                        let shape = all_meshes.shape(mesh, options)?;
                        known.push((mesh, shape.clone()));
                        shape
                    }
                }
            }
            (other, _) => return Err(file.fault(format!("has geoms of the unknown kind {other}"))),
        };
        robot.notes.extend(
            shape
                .notes()
                .map(|note| format!("geom `{}`: {note}", geom_names[geom])),
        );
        let link = bodies[geom].ok_or_else(|| file.fault("has geoms without bodies".to_owned()))?;
        all[geom] = Some((link, robot.links[link].collisions.len()));
        if let Some(parts) = &mut robot.precompiled {
            parts.frames.collisions[geom] = Some(robot.links[link].collisions.len());
        }
        robot.links[link].collisions.push(Collision {
            name: Some(geom_names[geom].clone()),
            pose: frame(places[geom], turns[geom]),
            shape,
            surface: Surface {
                mu: contact.friction[0],
                margin: contact.margin,
                gap: contact.gap,
                condim: contact.condim.min(3),
                ..Surface::default()
            },
            geom: Some(contact),
        });
    }
    Ok(all)
}

/// A shape that has nothing but sizes, by MuJoCo's word for it.
pub(super) fn primitive(kind: &str, [a, b, c]: [f64; 3]) -> Option<Shape> {
    Some(match kind {
        "mjGEOM_SPHERE" => Shape::Sphere { radius: a },
        "mjGEOM_CAPSULE" => Shape::Capsule {
            radius: a,
            half_height: b,
        },
        "mjGEOM_CYLINDER" => Shape::Cylinder {
            radius: a,
            half_height: b,
        },
        "mjGEOM_ELLIPSOID" => Shape::Ellipsoid { radii: [a, b, c] },
        "mjGEOM_BOX" => Shape::Box {
            half_extents: [a, b, c],
        },
        _ => return None,
    })
}

fn contacts(file: &ModelFile, count: usize) -> Result<Vec<GeomContact>, ModelError> {
    let contypes = file.integers("geom_contype", count)?;
    let conaffinities = file.integers("geom_conaffinity", count)?;
    let condims = file.integers("geom_condim", count)?;
    let priorities = file.integers("geom_priority", count)?;
    let solmixes = file.reals("geom_solmix", count)?;
    let softness = softness(file, "geom", count)?;
    let frictions = file.vectors::<3>("geom_friction", count)?;
    let margins = file.reals("geom_margin", count)?;
    let gaps = file.reals("geom_gap", count)?;
    let surface_velocities = match file.has("geom_surfacevel") {
        true => file.vectors::<6>("geom_surfacevel", count)?,
        false => vec![[0.0; 6]; count],
    };
    let adhesions = file.reals_or("geom_adhesion", count, 0.0)?;
    let all = (0..count).map(|k| GeomContact {
        contype: contypes[k] as u32,
        conaffinity: conaffinities[k] as u32,
        condim: usize::try_from(condims[k]).unwrap_or(3),
        priority: priorities[k],
        solmix: solmixes[k],
        softness: softness[k],
        friction: frictions[k],
        margin: margins[k],
        gap: gaps[k],
        surface_velocity: surface_velocities[k],
        adhesion: adhesions[k],
    });
    Ok(all.collect())
}
