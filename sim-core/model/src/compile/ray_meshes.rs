//! Triangles that rangefinders see, in boxes of triangles near each other.

use crate::description::Description;
use crate::geometry::TriMesh;
use sim_physics::constants::Constants;
use sim_physics::constants::sensors::RayTables;
use sim_physics::lane::Fixed;

/// A box is larger by this part of its mesh than its triangles need: more than `f32` rounds.
const ROUNDING: f64 = 1e-5;
/// Fewest triangles of a box that is split.
const SPLIT_MIN: usize = 16;

/// Corners of a triangle [m].
type Triangle = [[f64; 3]; 3];

/// Gives the geoms that rangefinders see their triangles.
pub(super) fn add_ray_meshes(m: &mut Constants<f64>, scene: &Description) {
    let (mut boxes, mut spans, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    let mut geoms = m.sensors.geoms.iter_mut();
    // geoms are those of all models, one after the other
    let models = scene.robots.iter();
    for parts in models.filter_map(|robot| Some(&robot.precompiled.as_ref()?.sensors)) {
        let mut of_meshes = Vec::with_capacity(parts.meshes.len());
        for mesh in &parts.meshes {
            let first = spans.len() / 2;
            push(mesh, &mut boxes, &mut spans, &mut triangles);
            of_meshes.push((first, spans.len() / 2));
        }
        for part in &parts.geoms {
            let geom = geoms
                .next()
                .expect("a model's geoms are among those of all");
            geom.boxes = part.mesh.map(|mesh| of_meshes[mesh]);
        }
    }
    if spans.is_empty() {
        return;
    }
    let tables = &mut m.contacts.tables;
    let (numbers, indices) = (tables.numbers.len(), tables.indices.len());
    let table = |base, stride, rows| Fixed { base, stride, rows };
    m.sensors.triangles = RayTables {
        boxes: table(numbers, 6, spans.len() / 2),
        spans: table(indices, 2, spans.len() / 2),
        triangles: table(numbers + boxes.len(), 9, triangles.len() / 9),
    };
    tables.numbers.extend(boxes);
    tables.numbers.extend(triangles);
    tables.indices.extend(spans);
}

/// Appends the triangles of a mesh, and its boxes: about as many as triangles in each. So a ray
/// looks at few of both.
fn push(mesh: &TriMesh, boxes: &mut Vec<f64>, spans: &mut Vec<u32>, triangles: &mut Vec<f64>) {
    let mut all: Vec<Triangle> = mesh.triangles.iter().map(|&t| mesh.corners(t)).collect();
    let most = ((all.len() as f64).sqrt().ceil() as usize).max(SPLIT_MIN);
    let [low, high] = extent(&all);
    let margin = ROUNDING * (0..3).fold(0.0, |most: f64, k| most.max(high[k] - low[k]));
    for part in split(&mut all, most) {
        let [low, high] = extent(part);
        boxes.extend([0, 1, 2].map(|k| 0.5 * (low[k] + high[k])));
        boxes.extend([0, 1, 2].map(|k| 0.5 * (high[k] - low[k]) + margin));
        let first = triangles.len() / 9;
        spans.extend([first as u32, (first + part.len()) as u32]);
        triangles.extend(part.as_flattened().as_flattened());
    }
}

/// Lowest and highest coordinates of triangles.
fn extent(triangles: &[Triangle]) -> [[f64; 3]; 2] {
    let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for corner in triangles.as_flattened() {
        for k in 0..3 {
            ends[0][k] = ends[0][k].min(corner[k]);
            ends[1][k] = ends[1][k].max(corner[k]);
        }
    }
    ends
}

/// Sorts triangles into parts of no more than `most` that are near each other.
fn split(triangles: &mut [Triangle], most: usize) -> Vec<&[Triangle]> {
    if triangles.is_empty() {
        return Vec::new();
    }
    if triangles.len() <= most {
        return vec![triangles];
    }
    // halves along the longest side of the box
    let [low, high] = extent(triangles);
    let size = |k: usize| high[k] - low[k];
    let axis = (1..3).fold(0, |axis, k| if size(k) > size(axis) { k } else { axis });
    let place = |triangle: &Triangle| triangle.iter().map(|corner| corner[axis]).sum::<f64>();
    triangles.sort_by(|a, b| place(a).total_cmp(&place(b)));
    let (first, second) = triangles.split_at_mut(triangles.len() / 2);
    let mut parts = split(first, most);
    parts.extend(split(second, most));
    parts
}
