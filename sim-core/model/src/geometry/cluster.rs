//! Meshes with fewer triangles, by vertex clustering (Rossignac and Borrel 1993).

use std::collections::{HashMap, HashSet};

/// A mesh that looks like another, with fewer triangles.
pub(super) struct Clustered {
    /// Means of the vertices of each cell that is used. `(vertices, 3)` [m]
    pub vertices: Vec<[f32; 3]>,
    /// Indices of the corners. `(triangles, 3)`
    pub triangles: Vec<[u32; 3]>,
    /// Which triangle of the other each was. `(triangles,)`
    pub kept: Vec<usize>,
    /// Edge of a cell [m].
    pub cell: f64,
}

/// Makes the vertices of each cell of a grid one, the grid as fine as this many triangles allow.
pub(super) fn cluster(vertices: &[[f32; 3]], triangles: &[[u32; 3]], most: usize) -> Clustered {
    let axis = |pick: fn(f32, f32) -> f32, start: f32| -> [f32; 3] {
        std::array::from_fn(|axis| vertices.iter().map(|v| v[axis]).fold(start, pick))
    };
    let (low, high) = (
        axis(f32::min, f32::INFINITY),
        axis(f32::max, f32::NEG_INFINITY),
    );
    let size = (0..3).map(|axis| f64::from(high[axis] - low[axis]));
    let size = size.fold(f64::MIN_POSITIVE, f64::max);
    let mut cells = 2048.0;
    loop {
        let mut place_of: HashMap<[u16; 3], u32> = HashMap::new();
        let places: Vec<u32> = vertices
            .iter()
            .map(|vertex| {
                let cell = std::array::from_fn(|axis| {
                    (f64::from(vertex[axis] - low[axis]) * (cells / size)) as u16
                });
                let next = place_of.len() as u32;
                *place_of.entry(cell).or_insert(next)
            })
            .collect();
        let (clustered, kept) = distinct(triangles, &places);
        if clustered.len() <= most {
            let (vertices, triangles) = used(&means(vertices, &places, place_of.len()), clustered);
            return Clustered {
                vertices,
                triangles,
                kept,
                cell: size / cells,
            };
        }
        // triangles of a surface grow with the square of the cells along it
        cells *= 0.98 * (most as f64 / clustered.len() as f64).sqrt();
    }
}

/// Triangles with their vertices renamed, each once and none with two corners in one place, and which they were.
fn distinct(triangles: &[[u32; 3]], places: &[u32]) -> (Vec<[u32; 3]>, Vec<usize>) {
    let mut met = HashSet::new();
    let renamed = triangles
        .iter()
        .map(|corners| corners.map(|corner| places[corner as usize]));
    let new = renamed.enumerate().filter(|(_, corners)| {
        let mut sorted = *corners;
        sorted.sort_unstable();
        sorted[0] != sorted[1] && sorted[1] != sorted[2] && met.insert(sorted)
    });
    new.map(|(index, corners)| (corners, index)).unzip()
}

/// Mean of the vertices in each place.
fn means(vertices: &[[f32; 3]], places: &[u32], count: usize) -> Vec<[f32; 3]> {
    let mut sums = vec![([0.0; 3], 0.0); count];
    for (vertex, &place) in vertices.iter().zip(places) {
        let (sum, members) = &mut sums[place as usize];
        *members += 1.0;
        for axis in 0..3 {
            sum[axis] += f64::from(vertex[axis]);
        }
    }
    let mean = |(sum, members): ([f64; 3], f64)| sum.map(|part| (part / members) as f32);
    sums.into_iter().map(mean).collect()
}

/// Without the vertices that no triangle has.
pub(super) fn used(
    vertices: &[[f32; 3]],
    mut triangles: Vec<[u32; 3]>,
) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut renamed = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    for corner in triangles.iter_mut().flatten() {
        let new = &mut renamed[*corner as usize];
        if *new == u32::MAX {
            *new = kept.len() as u32;
            kept.push(vertices[*corner as usize]);
        }
        *corner = *new;
    }
    (kept, triangles)
}
