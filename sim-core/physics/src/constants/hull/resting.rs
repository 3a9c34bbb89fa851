//! Which corners of a polygon rest on a plane with one of them, as MuJoCo chooses them.

/// Most corners that rest with a vertex.
pub const OTHERS: usize = 3;

/// The corners of a polygon that make a large quadrilateral with corner `at`, in their order around it; all of a small one.
///
/// They begin as the next three. The last moves on while the area grows; after each of its steps so does the second, then the
/// first. This is MuJoCo's choice (3.13 and later), which is not always the largest quadrilateral.
pub fn resting(vertices: &[[f64; 3]], corners: &[u32], at: usize) -> Vec<u32> {
    let corner = |k: usize| corners[(at + k) % corners.len()];
    let count = corners.len().min(OTHERS + 1);
    let mut chosen: Vec<usize> = (1..count).collect();
    if corners.len() > OTHERS + 1 {
        let place = |k: usize| vertices[corner(k) as usize];
        // twice the area, by its diagonals
        let area = |of: &[usize]| {
            let [ux, uy, uz] = sub(place(0), place(of[1]));
            let [vx, vy, vz] = sub(place(of[0]), place(of[2]));
            let [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
            (x * x + y * y + z * z).sqrt()
        };
        let mut largest = area(&chosen);
        let mut grows = |which: usize| {
            let mut moved = chosen.clone();
            moved[which] += 1;
            let here = area(&moved);
            let is_larger = here > largest;
            if is_larger {
                (chosen, largest) = (moved, here);
            }
            is_larger
        };
        while grows(2) {
            while grows(1) {}
            while grows(0) {}
        }
    }
    chosen.into_iter().map(corner).collect()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a polygon in the plane z = 0.
    fn flat<const N: usize>(places: [[f64; 2]; N]) -> Vec<[f64; 3]> {
        places.map(|[x, y]| [x, y, 0.0]).to_vec()
    }

    #[test]
    fn all_corners_of_a_small_polygon_rest() {
        let square = flat([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(resting(&square, &[0, 1, 2, 3], 2), [3, 0, 1]);
        assert_eq!(resting(&square, &[3, 1, 2], 1), [2, 3]);
    }

    #[test]
    fn corners_between_those_of_a_rectangle_do_not_rest() {
        let places = flat([
            [0.0, 0.0],
            [2.0, -0.1],
            [4.0, 0.0],
            [4.0, 3.0],
            [1.5, 3.1],
            [0.0, 3.0],
        ]);
        assert_eq!(resting(&places, &[0, 1, 2, 3, 4, 5], 0), [2, 3, 5]);
    }

    #[test]
    fn the_choice_ends_where_no_corner_alone_makes_it_larger() {
        // a step of the last corner makes the start smaller, though a larger one is beyond it
        let places = flat([
            [0.0, 0.0],
            [2.0, -1.0],
            [3.0, 0.0],
            [2.0, 1.0],
            [1.9, 0.9],
            [0.0, 3.0],
        ]);
        assert_eq!(resting(&places, &[0, 1, 2, 3, 4, 5], 0), [1, 2, 3]);
    }
}
