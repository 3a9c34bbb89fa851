//! Geoms of a model as shapes of links. Geoms that touch nothing are left to pictures.

use std::sync::Arc;

use super::format::ModelFile;
use super::frame;
use super::names::names;
use super::options::{MujocoOptions, has_flag};
use super::pairs::paired;
use super::tree::softness;
use crate::description::{Collision, Robot, Shape};
use crate::error::ModelError;
use crate::geom_contact::GeomContact;
use crate::geometry::{Mesh, MeshOptions, TriMesh};
use crate::surface::Surface;

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
    let mut known: Vec<(i64, Shape)> = Vec::new();
    for geom in 0..count {
        let contact = contacts[geom];
        if contact.contype == 0 && contact.conaffinity == 0 && !paired[geom] {
            continue;
        }
        let [a, b, c] = sizes[geom];
        let shape = match kinds[geom].as_str() {
            "mjGEOM_PLANE" => Shape::Plane,
            "mjGEOM_SPHERE" => Shape::Sphere { radius: a },
            "mjGEOM_CAPSULE" => Shape::Capsule {
                radius: a,
                half_height: b,
            },
            "mjGEOM_CYLINDER" => Shape::Cylinder {
                radius: a,
                half_height: b,
            },
            "mjGEOM_BOX" => Shape::Box {
                half_extents: [a, b, c],
            },
            "mjGEOM_MESH" => {
                let mesh = meshes[geom];
                match known.iter().find(|(other, _)| *other == mesh) {
                    Some((_, shape)) => shape.clone(),
                    None => {
                        let shape = mesh_shape(file, mesh, options)?;
                        known.push((mesh, shape.clone()));
                        shape
                    }
                }
            }
            other => return Err(file.fault(format!("has geoms of the unknown kind {other}"))),
        };
        robot.notes.extend(
            shape
                .notes()
                .map(|note| format!("geom `{}`: {note}", geom_names[geom])),
        );
        let link = bodies[geom].ok_or_else(|| file.fault("has geoms without bodies".to_owned()))?;
        all[geom] = Some((link, robot.links[link].collisions.len()));
        if let Some(parts) = &mut robot.mujoco {
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
    });
    Ok(all.collect())
}

/// The convex hull of a mesh; MuJoCo has put its vertices into the geom's frame.
fn mesh_shape(file: &ModelFile, mesh: i64, options: &MujocoOptions) -> Result<Shape, ModelError> {
    let meshes = file.rows("mesh_vertadr");
    let mesh = usize::try_from(mesh).ok().filter(|&mesh| mesh < meshes);
    let mesh = mesh.ok_or_else(|| file.fault("has a geom without its mesh".to_owned()))?;
    let part = |adr: &str, num: &str, end: usize| -> Result<std::ops::Range<usize>, ModelError> {
        let first = file.integers(adr, meshes)?[mesh];
        let count = file.integers(num, meshes)?[mesh];
        let range = usize::try_from(first).unwrap_or(end)
            ..usize::try_from(first + count).unwrap_or(end + 1);
        match range.start <= range.end && range.end <= end {
            true => Ok(range),
            false => Err(file.fault(format!("array `{adr}` points beyond its mesh"))),
        }
    };
    let vertices = file.rows("mesh_vert");
    let own = part("mesh_vertadr", "mesh_vertnum", vertices)?;
    let points = file.vectors::<3>("mesh_vert", vertices)?[own.clone()].to_vec();
    let faces = file.rows("mesh_face");
    let range = part("mesh_faceadr", "mesh_facenum", faces)?;
    let faces = &file.vectors_of_integers::<3>("mesh_face", faces)?[range];
    let triangles: Vec<[u32; 3]> = faces
        .iter()
        .map(|face| face.map(|corner| u32::try_from(corner).unwrap_or(u32::MAX)))
        .collect();
    if triangles
        .iter()
        .flatten()
        .any(|&corner| corner as usize >= points.len())
    {
        return Err(file.fault("has a mesh with corners that are not there".to_owned()));
    }
    // vertices of the hull that MuJoCo made, which `maxhullvert` may limit
    let corners = file.rows("mesh_hullvert");
    let own_hull = part("mesh_hulladr", "mesh_hullnum", corners)?;
    let corners = &file.integers("mesh_hullvert", corners)?[own_hull];
    let hull = corners.iter().map(|&corner| {
        let place = usize::try_from(corner).ok();
        place.and_then(|place| points.get(place)).copied()
    });
    let hull: Option<Vec<[f64; 3]>> = hull.collect();
    let hull =
        hull.ok_or_else(|| file.fault("has a hull with corners that are not there".to_owned()))?;
    let name = &names(file, "mesh", meshes)?[mesh];
    let mesh = Mesh::of(
        name,
        TriMesh {
            vertices: points,
            triangles,
        },
        (!hull.is_empty()).then_some(&hull[..]),
        &MeshOptions {
            max_hull_vertices: options.max_hull_vertices,
            convex_decomposition: false,
        },
    )?;
    Ok(Shape::Mesh(Arc::new(mesh)))
}
