//! The surface of a height field as it is shown: cells that lie in one plane are one piece.
//!
//! Merging vertices by their places, as for other large meshes, would round off steps and close gaps. Here every sample
//! stays where it is, and no gap opens: the outline of a piece has all corners of its neighbours.

use super::height_field::HeightField;
use super::trimesh::TriMesh;

/// Most triangles of a field that are shown; one that has more is shown with every second sample, or fewer.
const TRIANGLES_MAX: usize = 4_000_000;
/// Side of a square of the ground, which is drawn in two tones, if the field is between these many squares long [m].
const SQUARE: f64 = 1.0;
const SQUARES: [f64; 2] = [4.0, 500.0];
/// How far samples of a piece may be from its plane, over the length of a cell [–].
const FLAT: f64 = 1e-4;

/// Samples from `rows[0]` to `rows[1]` and `columns[0]` to `columns[1]`, in one plane unless it is a single cell.
struct Piece {
    rows: [usize; 2],
    columns: [usize; 2],
}

impl HeightField {
    /// Lengths of a square of the ground along x and y, whole cells [m]; the first begins at the lowest corner.
    pub fn squares(&self) -> [f64; 2] {
        let (cells, cell) = (self.square_cells(), self.cell());
        [0, 1].map(|axis| cells[axis] as f64 * cell[axis])
    }

    fn square_cells(&self) -> [usize; 2] {
        let length = 2.0 * self.half[0].max(self.half[1]);
        let mut side = SQUARE;
        while length < SQUARES[0] * side {
            side /= 10.0;
        }
        while length > SQUARES[1] * side {
            side *= 10.0;
        }
        self.cell()
            .map(|cell| (side / cell).round().max(1.0) as usize)
    }

    /// Its surface as it is shown, no piece of which goes beyond a square, and a note if samples are left out.
    pub fn shown(&self) -> (TriMesh, Option<String>) {
        let pieces = self.pieces();
        let surface = self.joined(&pieces);
        let count = surface.triangles.len();
        if count <= TRIANGLES_MAX {
            return (surface, None);
        }
        let mut every = 2;
        loop {
            let coarse = self.thinned(every);
            let surface = coarse.joined(&coarse.pieces());
            if surface.triangles.len() <= TRIANGLES_MAX {
                let note = format!(
                    "has {count} triangles and is shown with one sample in {every} along x and y"
                );
                return (surface, Some(note));
            }
            every *= 2;
        }
    }

    /// The field of every so-manyth sample; its lengths stay.
    fn thinned(&self, every: usize) -> HeightField {
        let [rows, columns] =
            [self.rows, self.columns].map(|count| ((count - 1) / every).max(1) + 1);
        let place = |i: usize, few: usize, all: usize| (i * (all - 1) + (few - 1) / 2) / (few - 1);
        let samples = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let elevations = samples.map(|(row, column)| {
            self.at(
                place(row, rows, self.rows),
                place(column, columns, self.columns),
            )
        });
        HeightField {
            elevations: elevations.collect(),
            rows,
            columns,
            path: self.path.clone(),
            ..*self
        }
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.elevations[row * self.columns + column]
    }

    /// Pieces that cover all cells, each as wide as its first row of cells allows and then as long.
    fn pieces(&self) -> Vec<Piece> {
        let (rows, columns, cell) = (self.rows - 1, self.columns - 1, self.cell());
        let [across, along] = self.square_cells();
        let slack = FLAT * cell[0].min(cell[1]);
        let mut taken = vec![false; rows * columns];
        let mut pieces = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                if taken[row * columns + column] {
                    continue;
                }
                let first = self.at(row, column);
                let right = self.at(row, column + 1) - first;
                let up = self.at(row + 1, column) - first;
                let is_flat = |r: usize, c: usize| {
                    [(0, 0), (0, 1), (1, 0), (1, 1)].iter().all(|(dr, dc)| {
                        let (r, c) = (r + dr, c + dc);
                        let plane = first + (c - column) as f64 * right + (r - row) as f64 * up;
                        (self.at(r, c) - plane).abs() <= slack
                    })
                };
                let fits = |r: usize, c: usize| !taken[r * columns + c] && is_flat(r, c);
                let (mut ends, limits) = (
                    [row + 1, column + 1],
                    [
                        ((row / along + 1) * along).min(rows),
                        ((column / across + 1) * across).min(columns),
                    ],
                );
                if is_flat(row, column) {
                    while ends[1] < limits[1] && fits(row, ends[1]) {
                        ends[1] += 1;
                    }
                    while ends[0] < limits[0] && (column..ends[1]).all(|c| fits(ends[0], c)) {
                        ends[0] += 1;
                    }
                }
                for r in row..ends[0] {
                    taken[r * columns + column..r * columns + ends[1]].fill(true);
                }
                pieces.push(Piece {
                    rows: [row, ends[0]],
                    columns: [column, ends[1]],
                });
            }
        }
        pieces
    }

    /// The closed surface of pieces: top, walls and bottom.
    fn joined(&self, pieces: &[Piece]) -> TriMesh {
        let (cell, last) = (self.cell(), [self.rows - 1, self.columns - 1]);
        let place = |row: usize, column: usize, z: f64| {
            let along = |axis: usize, i: usize| cell[axis] * i as f64 - self.half[axis];
            [along(0, column), along(1, row), z]
        };
        let mut numbers = vec![u32::MAX; self.rows * self.columns];
        let mut mesh = TriMesh::default();
        for piece in pieces {
            for (row, column) in piece.corners() {
                let number = &mut numbers[row * self.columns + column];
                if *number == u32::MAX {
                    *number = mesh.vertices.len() as u32;
                    mesh.vertices.push(place(row, column, self.at(row, column)));
                }
            }
        }
        let number = |(row, column): (usize, usize)| numbers[row * self.columns + column];
        let is_used = |&sample: &(usize, usize)| number(sample) != u32::MAX;
        for piece in pieces {
            let outline: Vec<u32> = piece.outline().filter(is_used).map(number).collect();
            if let [a, b, c, d] = outline[..] {
                mesh.triangles.extend([[a, c, d], [a, b, c]]);
                continue;
            }
            let [[x, y, z], [right, up, top]] = [0, 1].map(|end| {
                place(
                    piece.rows[end],
                    piece.columns[end],
                    self.at(piece.rows[end], piece.columns[end]),
                )
            });
            let middle = mesh.vertices.len() as u32;
            mesh.vertices
                .push([0.5 * (x + right), 0.5 * (y + up), 0.5 * (z + top)]);
            mesh.triangles
                .extend(ring(&outline).map(|[a, b]| [middle, a, b]));
        }
        let whole = Piece {
            rows: [0, last[0]],
            columns: [0, last[1]],
        };
        let around: Vec<(usize, usize)> = whole.outline().filter(is_used).collect();
        let first = mesh.vertices.len() as u32;
        let below = around
            .iter()
            .map(|&(row, column)| place(row, column, self.bottom));
        mesh.vertices.extend(below);
        let middle = mesh.vertices.len() as u32;
        mesh.vertices.push([0.0, 0.0, self.bottom]);
        let rim: Vec<u32> = (0..around.len() as u32).collect();
        for [here, next] in ring(&rim) {
            let [a, b] = [here, next].map(|k| number(around[k as usize]));
            let (c, d) = (first + here, first + next);
            mesh.triangles
                .extend([[a, c, d], [a, d, b], [middle, d, c]]);
        }
        mesh
    }
}

impl Piece {
    /// Once around, counter-clockwise from above.
    fn corners(&self) -> [(usize, usize); 4] {
        let ([bottom, top], [left, right]) = (self.rows, self.columns);
        [(bottom, left), (bottom, right), (top, right), (top, left)]
    }

    /// All samples of its rim, once around from the lowest corner.
    fn outline(&self) -> impl Iterator<Item = (usize, usize)> {
        let ([bottom, top], [left, right]) = (self.rows, self.columns);
        let there = (left..right).map(move |column| (bottom, column));
        let up = (bottom..top).map(move |row| (row, right));
        let back = (left + 1..=right).rev().map(move |column| (top, column));
        let down = (bottom + 1..=top).rev().map(move |row| (row, left));
        there.chain(up).chain(back).chain(down)
    }
}

/// Each vertex of a ring with the next one.
fn ring(vertices: &[u32]) -> impl Iterator<Item = [u32; 2]> {
    let next = vertices.iter().cycle().skip(1);
    vertices.iter().zip(next).map(|(&a, &b)| [a, b])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stairs along x, 3 cells deep, beside rough ground, on 12 m by 10 m.
    fn stairs() -> HeightField {
        let (rows, columns) = (101, 121);
        let elevations = (0..rows * columns).map(|k| match (k / columns, k % columns) {
            (row, column) if row < 60 => 0.15 * (column / 3) as f64,
            (row, column) => 0.01 * ((row * 37 + column * 101) % 13) as f64,
        });
        HeightField::new([rows, columns], elevations.collect(), [12.0, 10.0], 1.0).unwrap()
    }

    #[test]
    fn cells_of_one_plane_are_few_triangles_with_the_field_s_volume_and_no_gap() {
        let field = stairs();
        let ((shown, note), whole) = (field.shown(), field.surface());
        assert_eq!(note, None);
        // 40 of its 100 rows of cells are rough
        assert!(shown.triangles.len() < whole.triangles.len() / 2);
        let (shown_volume, volume) = (shown.signed_volume(), whole.signed_volume());
        assert!(
            (shown_volume - volume).abs() < 1e-9 * volume,
            "{shown_volume} {volume}"
        );
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for [a, b, c] in shown.triangles {
            edges.extend([[a, b], [b, c], [c, a]]);
        }
        edges.sort_unstable();
        assert!(edges.windows(2).all(|pair| pair[0] != pair[1]));
        let is_there = |&[a, b]: &[u32; 2]| edges.binary_search(&[b, a]).is_ok();
        assert!(edges.iter().all(is_there));
    }

    #[test]
    fn a_field_of_fewer_samples_has_its_corners_and_its_size() {
        let field = stairs();
        let coarse = field.thinned(4);
        assert_eq!([coarse.rows, coarse.columns], [26, 31]);
        assert_eq!(coarse.half, field.half);
        assert_eq!(coarse.at(25, 30).to_bits(), field.at(100, 120).to_bits());
        assert_eq!(coarse.at(0, 1).to_bits(), field.at(0, 4).to_bits());
    }
}
