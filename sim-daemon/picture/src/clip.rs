//! Triangles cut off where the camera cannot see or whole numbers end.

/// Nearest that is drawn, in parts of the distance to the camera's target.
pub(crate) const NEAREST: f32 = 1e-3;
/// How far beside the picture corners may lie, as a tangent over that of the picture's edge: larger ones are cut.
pub(crate) const ASIDE: f32 = 16.0;

/// A corner as the camera sees it: to the right and up, over the tangent of the picture's edge, and the distance ahead.
pub(crate) type Ahead = [f32; 3];

/// Signed room of a corner against each plane: the nearest distance, then right, left, top and bottom.
fn room(corner: &Ahead, nearest: f32) -> [f32; 5] {
    let [x, y, z] = *corner;
    let wide = ASIDE * z;
    [z - nearest, wide - x, wide + x, wide - y, wide + y]
}

/// Whether it can be drawn as it is.
pub(crate) fn is_free(corner: &Ahead, nearest: f32) -> bool {
    room(corner, nearest).iter().all(|&room| room >= 0.0)
}

/// The part of a triangle that can be drawn, as the corners of a convex polygon; empty if there is none.
pub(crate) fn clipped(corners: [Ahead; 3], nearest: f32) -> Vec<Ahead> {
    let mut polygon = corners.to_vec();
    for plane in 0..5 {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (index, corner) in polygon.iter().enumerate() {
            let next = &polygon[(index + 1) % polygon.len()];
            let (here, there) = (room(corner, nearest)[plane], room(next, nearest)[plane]);
            if here >= 0.0 {
                kept.push(*corner);
            }
            if (here < 0.0) != (there < 0.0) {
                let share = here / (here - there);
                kept.push(std::array::from_fn(|k| {
                    corner[k] + share * (next[k] - corner[k])
                }));
            }
        }
        polygon = kept;
    }
    polygon
}
