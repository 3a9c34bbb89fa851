//! Which samples lie in a triangle, in whole numbers: triangles that share an edge leave no gap.

use std::ops::Range;

/// Parts of a pixel in which corners and samples are placed.
pub(crate) const SUB: i64 = 16;

/// The next whole number down; the standard library's is a call where the processor's instruction is not assumed.
#[inline(always)]
pub(crate) fn floor(x: f32) -> i32 {
    let whole = x as i32;
    whole - i32::from(x < whole as f32)
}

/// Calls `each` for the pixels of which some samples lie inside a triangle, rim included.
///
/// Corners and samples are in 16ths of a pixel: sample k of the pixel (x, y) is at `(16 x, 16 y) + samples[k]`. `each` gets
/// x, y, which samples are inside, and three times the weight of each corner at each sample: numbers that add up to
/// twice the triangle's area, which comes last.
#[inline(always)]
pub(crate) fn cover<const SAMPLES: usize>(
    [a, b, c]: &[[i64; 2]; 3],
    samples: &[[i64; 2]; SAMPLES],
    columns: Range<i64>,
    rows: Range<i64>,
    mut each: impl FnMut(i64, i64, [bool; SAMPLES], &[[i64; SAMPLES]; 3], i64),
) {
    let span = |axis: usize, all: Range<i64>| {
        let low = a[axis].min(b[axis]).min(c[axis]).div_euclid(SUB);
        let high = a[axis].max(b[axis]).max(c[axis]).div_euclid(SUB);
        low.max(all.start)..(high + 1).min(all.end)
    };
    let (columns, rows) = (span(0, columns), span(1, rows));
    // twice the signed area of a triangle
    let area = |a: &[i64; 2], b: &[i64; 2], c: &[i64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = area(a, b, c);
    if whole == 0 || columns.is_empty() || rows.is_empty() {
        return;
    }
    let sign = whole.signum();
    let edges = [(b, c), (c, a), (a, b)];
    // each changes by the same step from pixel to pixel
    let right = edges.map(|(p, q)| -sign * (q[1] - p[1]) * SUB);
    let down = edges.map(|(p, q)| sign * (q[0] - p[0]) * SUB);
    let first = [columns.start * SUB, rows.start * SUB];
    let mut line: [[i64; SAMPLES]; 3] = std::array::from_fn(|k| {
        let (p, q) = edges[k];
        samples.map(|[x, y]| sign * area(p, q, &[first[0] + x, first[1] + y]))
    });
    for y in rows {
        let mut parts = line;
        for x in columns.clone() {
            let inside: [bool; SAMPLES] =
                std::array::from_fn(|k| (parts[0][k] | parts[1][k] | parts[2][k]) >= 0);
            if inside.iter().any(|&inside| inside) {
                each(x, y, inside, &parts, whole.abs());
            }
            for k in 0..3 {
                for part in &mut parts[k] {
                    *part += right[k];
                }
            }
        }
        for k in 0..3 {
            for part in &mut line[k] {
                *part += down[k];
            }
        }
    }
}
