//! The base colours of a glTF file: factor, image and colours of vertices, multiplied.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use gltf::Primitive;
use gltf::image::Source;
use gltf::mesh::Semantic;

use super::super::visual::{Color, Image};
use super::color::{color_of_light, mean};
use super::gltf_rows::{Buffers, base64_of};
use super::raw::{Material, Run, Texture, Uv};

/// Images of a file, read when they are met first.
pub(super) struct Images<'a> {
    folder: &'a Path,
    read: HashMap<usize, Rc<Image>>,
}

impl<'a> Images<'a> {
    pub fn new(folder: &'a Path) -> Images<'a> {
        Images {
            folder,
            read: HashMap::new(),
        }
    }

    /// An image; `None` where its bytes are not there.
    fn image(&mut self, image: &gltf::Image, buffers: &Buffers) -> Option<Rc<Image>> {
        if let Some(image) = self.read.get(&image.index()) {
            return Some(image.clone());
        }
        let content = match image.source() {
            Source::View { view, .. } => Image::Bytes(buffers.view(&view)?.to_vec()),
            Source::Uri { uri, .. } => match uri.strip_prefix("data:") {
                Some(data) => Image::Bytes(base64_of(data).ok()?),
                None => Image::File(self.folder.join(uri)),
            },
        };
        let content = Rc::new(content);
        self.read.insert(image.index(), content.clone());
        Some(content)
    }
}

/// What the triangles of a primitive look like; these are indices among its own vertices.
pub(super) fn looks(
    primitive: &Primitive,
    triangles: &[[usize; 3]],
    buffers: &Buffers,
    images: &mut Images,
) -> Run {
    let mut run = Run {
        count: triangles.len(),
        ..Run::default()
    };
    let rows = |semantic| {
        let accessor = primitive.get(&semantic)?;
        let rows = buffers.shares(&accessor).ok()?;
        let largest = triangles.iter().flatten().max()?;
        (*largest < rows.len()).then_some(rows)
    };
    let material = primitive.material();
    let shares = rows(Semantic::Colors(0));
    if material.index().is_none() && shares.is_none() {
        return run;
    }
    let base = material.pbr_metallic_roughness();
    let factor = base.base_color_factor().map(f64::from);
    if let Some(shares) = shares {
        let color = |corners: &[usize; 3]| {
            let share = mean(corners.map(|corner| shares[corner].map(f64::from)));
            color_of_light(std::array::from_fn(|part| factor[part] * share[part]))
        };
        run.colors = triangles.iter().map(color).collect();
    }
    let color: Color = color_of_light(factor);
    run.material = Material {
        color: Some(color),
        texture: None,
    };
    let Some(info) = base.base_color_texture() else {
        return run;
    };
    if let Some(image) = images.image(&info.texture().source(), buffers) {
        // both as a screen has them: right where one of them is white, which is nearly always
        run.material.texture = Some(Texture { image, tint: color });
        if let Some(places) = rows(Semantic::TexCoords(info.tex_coord())) {
            // counted from the top
            let uv = |corners: &[usize; 3]| -> Uv {
                corners.map(|corner| [places[corner][0], 1.0 - places[corner][1]])
            };
            run.uv = triangles.iter().map(uv).collect();
        }
    }
    run
}
