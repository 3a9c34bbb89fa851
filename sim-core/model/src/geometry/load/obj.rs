//! Wavefront OBJ: the vertices and faces of all its objects and groups; materials, normals and textures play no part.

use super::{Limits, RawMesh, lines};

pub(super) fn read(bytes: &[u8], limits: Limits) -> Result<RawMesh, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut mesh = RawMesh::default();
    let mut corners = Vec::new();
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
        match words.next() {
            Some("v") => {
                let mut next = || words.next()?.parse::<f64>().ok();
                // what may follow is a weight or a colour
                let (Some(x), Some(y), Some(z)) = (next(), next(), next()) else {
                    return Err(fault(index, "is not `v` and three numbers"));
                };
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
                mesh.polygon(&corners);
                limits.triangles(mesh.triangles.len())?;
            }
            _ => {}
        }
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
