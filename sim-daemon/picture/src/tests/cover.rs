//! Which samples lie in a triangle.

use crate::cover::{SUB, cover};

const MIDDLE: [[i64; 2]; 1] = [[SUB / 2; 2]];

#[test]
fn triangles_that_share_an_edge_leave_no_gap() {
    // a fan around a point that is nowhere near a sample's middle
    let hub = [1003, 997];
    let rim: Vec<[i64; 2]> = (0..37)
        .map(|step| {
            let angle = std::f64::consts::TAU * f64::from(step) / 37.0;
            [
                hub[0] + (900.0 * angle.cos()) as i64,
                hub[1] + (900.0 * angle.sin()) as i64,
            ]
        })
        .collect();
    let (columns, lines) = (128, 128);
    let mut hits = vec![0; columns * lines];
    for (step, &corner) in rim.iter().enumerate() {
        let next = rim[(step + 1) % rim.len()];
        let (wide, tall) = (0..columns as i64, 0..lines as i64);
        cover(
            &[hub, corner, next],
            &MIDDLE,
            wide,
            tall,
            |x, y, _, parts, whole| {
                assert_eq!(parts.iter().map(|part| part[0]).sum::<i64>(), whole);
                hits[y as usize * columns + x as usize] += 1;
            },
        );
    }
    for line in 0..lines {
        for column in 0..columns {
            let [x, y] = [column, line].map(|part| 16.0 * part as f64 + 8.0);
            let away = (x - hub[0] as f64).hypot(y - hub[1] as f64);
            let hit = hits[line * columns + column];
            // 37 corners on a circle of 900 keep 896.7 of it
            assert!(away > 896.0 || hit > 0, "({column}, {line}) is a gap");
            assert!(away < 901.5 || hit == 0, "({column}, {line}) is outside");
        }
    }
}
