//! Normals to shade by.

use super::ball_triangles;
use crate::normals::corner_normals;

#[test]
fn a_ball_is_shaded_round() {
    let (vertices, mut triangles) = ball_triangles(2.0, 24);
    let vertices: Vec<[f64; 3]> = vertices.iter().map(|v| v.map(f64::from)).collect();
    // at a pole one of the two triangles of a patch has no area
    triangles.retain(|corners| {
        let [a, b, c] = corners.map(|vertex| vertices[vertex as usize].map(|x| (1e6 * x) as i64));
        a != b && b != c && c != a
    });
    for (corners, normals) in triangles.iter().zip(corner_normals(&vertices, &triangles)) {
        for (vertex, normal) in corners.iter().zip(normals) {
            let radial = vertices[*vertex as usize].map(|part| part / 2.0);
            let parts = (0..3).map(|axis| radial[axis] * f64::from(normal[axis]) / 32767.0);
            let cosine: f64 = parts.sum();
            // facets are 7.5° wide: at a pole each leans outwards by half of that
            assert!(cosine > 0.99, "{cosine}");
        }
    }
}

#[test]
fn a_box_is_shaded_flat() {
    let vertices: Vec<[f64; 3]> = (0..8)
        .map(|k| [k & 1, k >> 1 & 1, k >> 2].map(f64::from))
        .collect();
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles: Vec<[u32; 3]> = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    for normals in corner_normals(&vertices, &triangles) {
        assert!(normals == [normals[0]; 3], "{normals:?}");
        let parts = normals[0].map(|part| i32::from(part).abs());
        assert_eq!(parts.iter().sum::<i32>(), 32767);
    }
}
