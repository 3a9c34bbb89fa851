//! MTL: the materials of a Wavefront OBJ file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::super::visual::Image;
use super::bytes_of;
use super::color::color_of;
use super::raw::{Material, Texture};
use super::text::{lines, text_of};

/// Largest file of materials [bytes]: each is some lines.
const MTL_MAX: u64 = 16 << 20;

/// What a file says of a material.
struct Entry {
    name: String,
    /// `Kd`.
    diffuse: Option<[f64; 3]>,
    /// `d`, or what `Tr` leaves.
    opacity: f64,
    /// `map_Kd`.
    image: Option<PathBuf>,
}

/// Materials by name; none where the file cannot be read, as its mesh has a shape without them.
pub(super) fn read(folder: &Path, name: &str) -> HashMap<String, Material> {
    let Ok(bytes) = bytes_of(&folder.join(name), MTL_MAX) else {
        return HashMap::new();
    };
    let Ok(text) = text_of(&bytes) else {
        return HashMap::new();
    };
    let mut entries: Vec<Entry> = Vec::new();
    for line in lines(&text) {
        let line = line.trim();
        let (keyword, rest) = line
            .split_once(|c: char| c.is_ascii_whitespace())
            .unwrap_or((line, ""));
        let (keyword, rest) = (keyword.to_ascii_lowercase(), rest.trim());
        if keyword == "newmtl" {
            entries.push(Entry {
                name: rest.to_owned(),
                diffuse: None,
                opacity: 1.0,
                image: None,
            });
        }
        let Some(entry) = entries.last_mut() else {
            continue;
        };
        let last = rest.split_ascii_whitespace().next_back();
        let number = last.and_then(|word| word.parse::<f64>().ok());
        match (keyword.as_str(), number) {
            ("kd", _) => entry.diffuse = diffuse(rest).or(entry.diffuse),
            ("map_kd", _) => entry.image = Some(image(folder, rest)),
            ("d", Some(opacity)) => entry.opacity = opacity,
            ("tr", Some(share)) => entry.opacity = 1.0 - share,
            _ => {}
        }
    }
    entries
        .into_iter()
        .map(|entry| (entry.name.clone(), entry.material()))
        .collect()
}

impl Entry {
    fn material(self) -> Material {
        // what would be invisible is an exporter's slip
        let visible = self.opacity > 0.0 && self.opacity <= 1.0;
        let opacity = if visible { self.opacity } else { 1.0 };
        Material {
            color: self.diffuse.map(|[r, g, b]| color_of([r, g, b, opacity])),
            texture: self.image.map(|path| Texture {
                image: Rc::new(Image::File(path)),
                tint: color_of([1.0, 1.0, 1.0, opacity]),
            }),
        }
    }
}

/// Red, green and blue; one number stands for all three.
fn diffuse(text: &str) -> Option<[f64; 3]> {
    let numbers = text.split_ascii_whitespace().map(|word| word.parse().ok());
    let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
    match numbers[..] {
        [grey] => Some([grey; 3]),
        [r, g, b, ..] => Some([r, g, b]),
        _ => None,
    }
}

/// The file of a map: the whole line, as names may hold spaces, or what follows the map's options.
fn image(folder: &Path, text: &str) -> PathBuf {
    let file = |name: &str| folder.join(name.replace('\\', "/"));
    let whole = file(text);
    let last = text.split_ascii_whitespace().next_back().map(file);
    match last {
        Some(last) if !whole.is_file() && last.is_file() => last,
        _ => whole,
    }
}
