//! STL: bare triangles, as text or in binary.
//!
//! A binary file may begin with `solid` as a text does, so the length tells them apart: 84 bytes, then 50 a triangle.

use super::text::{is_wide, lines, text_of};
use super::{Limits, RawMesh};

/// Bytes before the first triangle of a binary file: a comment of 80, then the number of triangles.
const HEADER: usize = 84;
/// Bytes of a triangle: normal and three corners as 12 f32, then 2 that nothing reads.
const RECORD: usize = 50;

pub(super) fn read(bytes: &[u8], limits: Limits) -> Result<RawMesh, String> {
    let claimed = bytes
        .get(80..HEADER)
        .and_then(|count| count.try_into().ok())
        .map(|count| u32::from_le_bytes(count) as usize);
    let exact = claimed.is_some_and(|count| bytes.len() - HEADER == count.saturating_mul(RECORD));
    if !exact && (is_text(bytes) || is_wide(bytes)) {
        return read_text(bytes, limits);
    }
    let Some(claimed) = claimed else {
        let size = bytes.len();
        return Err(format!(
            "it has {size} bytes, a binary STL file at least {HEADER}; export it again"
        ));
    };
    let held = (bytes.len() - HEADER) / RECORD;
    if claimed > held {
        return Err(format!(
            "its header tells of {claimed} triangles, but it holds {held}; it was cut short, copy or export it again"
        ));
    }
    if claimed < held {
        return Err(format!(
            "its header tells of {claimed} triangles, but it holds {held}; export it again"
        ));
    }
    limits.triangles(claimed)?;
    let mut mesh = RawMesh::default();
    for record in bytes[HEADER..].chunks_exact(RECORD).take(claimed) {
        let number = |index: usize| {
            let at = 12 + 4 * index;
            let bytes = [record[at], record[at + 1], record[at + 2], record[at + 3]];
            f64::from(f32::from_le_bytes(bytes))
        };
        mesh.triangle([0, 3, 6].map(|first| [first, first + 1, first + 2].map(number)));
    }
    Ok(mesh)
}

/// Whether it begins with the word `solid`, and is text where a binary file has numbers.
fn is_text(bytes: &[u8]) -> bool {
    let start = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let start = start.trim_ascii_start();
    let word = start
        .get(..5)
        .is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    let sample = &bytes[..bytes.len().min(1024)];
    word && !sample.contains(&0)
}

/// Every `vertex x y z`; three make a triangle, whatever loops and facets are called around them.
fn read_text(bytes: &[u8], limits: Limits) -> Result<RawMesh, String> {
    let text = text_of(bytes)?;
    let mut mesh = RawMesh::default();
    let mut corners: Vec<[f64; 3]> = Vec::with_capacity(3);
    let mut ended = false;
    for (line, words) in (1..).zip(lines(&text)) {
        let mut words = words.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        // some write `end solid`, and notes below it
        let next = words.clone().next().unwrap_or_default();
        ended |= word.eq_ignore_ascii_case("endsolid")
            || word.eq_ignore_ascii_case("end") && next.eq_ignore_ascii_case("solid");
        if word.eq_ignore_ascii_case("vertex") {
            let numbers: Vec<f64> = words.filter_map(|word| word.parse().ok()).collect();
            let [x, y, z] = numbers[..] else {
                return Err(format!(
                    "line {line} is not `vertex` and three numbers; export it again"
                ));
            };
            corners.push([x, y, z]);
            ended = false;
        } else if word.eq_ignore_ascii_case("endloop") {
            let [a, b, c] = corners[..] else {
                let count = corners.len();
                return Err(format!(
                    "the facet that ends in line {line} has {count} corners, not 3; export it again"
                ));
            };
            mesh.triangle([a, b, c]);
            limits.triangles(mesh.triangles.len())?;
            corners.clear();
        }
    }
    if !ended || !corners.is_empty() {
        return Err(
            "it ends before `endsolid`; it was cut short, copy or export it again".to_owned(),
        );
    }
    Ok(mesh)
}
