//! Wavefront OBJ: the vertices and faces of all its objects and groups, with the materials of its MTL files; normals play no
//! part.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::color::{color_of, mean};
use super::mtl;
use super::raw::fan;
use super::text::{lines, text_of};
use super::{Limits, Material, RawMesh, Run};

/// Most files of materials that a mesh names: exporters write one or two.
const LIBRARIES_MAX: usize = 16;

pub(super) fn read(bytes: &[u8], folder: &Path, limits: Limits) -> Result<RawMesh, String> {
    let text = text_of(bytes)?;
    let mut mesh = RawMesh::default();
    let mut looks = limits.looks.then(|| Looks::new(folder));
    let (mut corners, mut places) = (Vec::new(), Vec::new());
    // a backslash continues a line; such files are rare, so only they are copied
    let joined;
    let text = if text.contains("\\\n") || text.contains("\\\r\n") {
        joined = text.replace("\\\r\n", " ").replace("\\\n", " ");
        &*joined
    } else {
        &*text
    };
    for (index, line) in lines(text).enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_ascii_whitespace();
        let keyword = words.next();
        if let Some(looks) = &mut looks {
            looks.line(keyword.unwrap_or_default(), line, mesh.triangles.len());
        }
        match keyword {
            Some("v") => {
                let mut next = || words.next()?.parse::<f64>().ok();
                let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
                    return Err(fault(index, "is not `v` and three numbers"));
                };
                // a weight or a colour may follow
                if let Some(word) = words.find(|word| word.parse::<f64>().is_err()) {
                    let problem = format!("has `{word}` behind its vertex");
                    return Err(fault(index, &problem));
                }
                mesh.vertices.push([x, y, z]);
            }
            Some("f" | "fo") => {
                corners.clear();
                for word in words {
                    corners.push(vertex(word, mesh.vertices.len()).ok_or_else(|| {
                        fault(
                            index,
                            &format!(
                                "names the vertex `{word}`, which is not among those before it"
                            ),
                        )
                    })?);
                }
                places.clear();
                places.extend(fan(0, corners.len()));
                mesh.extend(&corners, &places);
                if let Some(looks) = &mut looks {
                    looks.face(line, &corners, &places);
                }
                limits.triangles(mesh.triangles.len())?;
            }
            _ => {}
        }
    }
    if let Some(mut looks) = looks {
        looks.end_run(mesh.triangles.len());
        mesh.runs = looks.runs;
    }
    Ok(mesh)
}

fn fault(index: usize, problem: &str) -> String {
    format!("line {} {problem}; export it again", index + 1)
}

/// Index from 0 of the vertex of `v/vt/vn`: counted from 1, or backwards from the newest if negative.
fn vertex(word: &str, known: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let known = i64::try_from(known).ok()?;
    let index = if number < 0 {
        known + number
    } else {
        number - 1
    };
    (0..known).contains(&index).then_some(index as u32)
}

/// What the lines of a file say of looks, beside its triangles.
struct Looks<'a> {
    folder: &'a Path,
    materials: HashMap<String, Material>,
    /// Names of the files that were read: a line that repeats one reads nothing.
    libraries: HashSet<String>,
    /// Texture coordinates, counted as vertices are.
    uv: Vec<[f32; 2]>,
    /// Colour of each vertex, where a line gives it.
    colors: Vec<Option<[f64; 4]>>,
    runs: Vec<Run>,
    /// The run that is being read; its count comes at its end.
    run: Run,
}

impl Looks<'_> {
    fn new(folder: &Path) -> Looks<'_> {
        Looks {
            folder,
            materials: HashMap::new(),
            libraries: HashSet::new(),
            uv: Vec::new(),
            colors: Vec::new(),
            runs: Vec::new(),
            run: Run::default(),
        }
    }

    /// Takes a line, so many triangles after the start.
    fn line(&mut self, keyword: &str, line: &str, triangles: usize) {
        let rest = || line.trim_start()[keyword.len()..].trim();
        let numbers = || rest().split_ascii_whitespace().map(str::parse::<f64>);
        match keyword {
            "v" => {
                let color: Vec<f64> = numbers().skip(3).map_while(Result::ok).collect();
                self.colors.push(match color[..] {
                    [r, g, b] | [r, g, b, _] => Some([r, g, b, 1.0]),
                    _ => None, // nothing, or a weight
                });
            }
            "vt" => {
                let mut next = numbers().map(|number| number.unwrap_or(0.0) as f32);
                self.uv
                    .push([next.next().unwrap_or(0.0), next.next().unwrap_or(0.0)]);
            }
            // names may hold spaces
            "mtllib"
                if self.libraries.len() < LIBRARIES_MAX
                    && self.libraries.insert(rest().to_owned()) =>
            {
                self.materials.extend(mtl::read(self.folder, rest()));
            }
            "usemtl" => {
                self.end_run(triangles);
                self.run.material = self.materials.get(rest()).cloned().unwrap_or_default();
            }
            _ => {}
        }
    }

    /// Takes the triangles of a face.
    fn face(&mut self, line: &str, corners: &[u32], places: &[[usize; 3]]) {
        let Material { color, texture } = &self.run.material;
        if texture.is_some() {
            let words = line.split_ascii_whitespace().skip(1);
            let uv: Option<Vec<_>> = words
                .map(|word| {
                    let at = vertex(word.split('/').nth(1)?, self.uv.len())?;
                    Some(self.uv[at as usize])
                })
                .collect();
            if let Some(uv) = uv {
                let triangles = places.iter().map(|places| places.map(|at| uv[at]));
                self.run.uv.extend(triangles);
            }
        } else if color.is_none() {
            for places in places {
                let [a, b, c] = places.map(|at| self.colors[corners[at] as usize]);
                if let (Some(a), Some(b), Some(c)) = (a, b, c) {
                    self.run.colors.push(color_of(mean([a, b, c])));
                }
            }
        }
    }

    /// Ends the run, so many triangles after the start.
    fn end_run(&mut self, triangles: usize) {
        let mut run = std::mem::take(&mut self.run);
        self.run.first = triangles;
        run.count = triangles - run.first;
        // what only some faces have is left out
        if run.uv.len() != run.count {
            run.uv.clear();
        }
        if run.colors.len() != run.count {
            run.colors.clear();
        }
        if run.count > 0 {
            self.runs.push(run);
        }
    }
}
