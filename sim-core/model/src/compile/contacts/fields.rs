//! Tables of height fields: elevations, the highest of each cell and around each tile, and how many cells each pair visits.

use super::pieces::{Piece, PlacedShape};
use crate::description::Shape;
use crate::error::ModelError;
use crate::geometry::{HeightField, SAMPLES_MAX};
use sim_physics::constants::contact::{Contacts, Kind};
use sim_physics::constants::height_field::{FIELD_CANDIDATES, FieldTables, TILE, field};
use sim_physics::lane::{Fixed, Table};

/// Most prisms that one shape may lie over: more would take longer than a mesh.
const PRISMS_MAX: usize = 20_000;

/// Most points that a prism and a shape have in common: two for each edge of a triangle.
const POINTS_OF_A_PRISM: usize = 6;

/// The height fields among shapes, in the order of their rows.
fn fields<'a>(shapes: &'a [PlacedShape<'_>]) -> Vec<(usize, &'a HeightField)> {
    let as_field = |(index, shape): (usize, &'a PlacedShape<'_>)| match shape.shape {
        Shape::HeightField(field) => Some((index, &**field)),
        _ => None,
    };
    shapes.iter().enumerate().filter_map(as_field).collect()
}

/// Adds the tables of all height fields to those of the contacts.
///
/// # Errors
/// More samples than the tables hold, or a shape that is too large for the cells of a field.
pub(super) fn add_fields(
    contacts: &mut Contacts<f64>,
    shapes: &[PlacedShape<'_>],
    pieces: &[Piece],
    pairs: &[(usize, usize)],
    reach: impl Fn(usize) -> f64,
    names: &[String],
) -> Result<(), ModelError> {
    let all = fields(shapes);
    if all.is_empty() {
        return Ok(());
    }
    let refuse = |name: &str, reason| ModelError::HeightField(format!("shape `{name}`"), reason);
    let samples: usize = all.iter().map(|(_, field)| field.elevations.len()).sum();
    if samples > SAMPLES_MAX {
        return Err(refuse(
            &names[shapes[all[0].0].number],
            format!(
                "the scene's height fields have {samples} samples, more than {SAMPLES_MAX}; make them coarser"
            ),
        ));
    }
    // per pair: how far the second shape reaches from its centre
    let mut farthest = vec![0.0_f64; all.len()];
    let mut under = vec![0_u32; pairs.len()];
    for (p, &(a, b)) in pairs.iter().enumerate() {
        if pieces[a].solid.kind != Kind::Field {
            continue;
        }
        let place = pieces[a].hull;
        let radius = pieces[b].radius + reach(p);
        farthest[place] = farthest[place].max(radius);
        let cell = all[place].1.cell();
        // a length covers so many cells, however it lies
        let cells = |axis: usize| ((2.0 * radius / cell[axis]).ceil() as usize).saturating_add(2);
        let count = 2_usize.saturating_mul(cells(0)).saturating_mul(cells(1));
        let there = 2 * (all[place].1.rows - 1) * (all[place].1.columns - 1);
        let count = count.min(there);
        if count > PRISMS_MAX {
            let [field, other] = [a, b].map(|piece| &names[shapes[pieces[piece].shape].number]);
            return Err(refuse(
                field,
                format!(
                    "shape `{other}` lies over {count} of its triangles, more than {PRISMS_MAX}; make its cells larger, \
                     or keep the two from touching by a contact filter"
                ),
            ));
        }
        under[p] = (count / 2) as u32;
    }
    let (mut sizes, mut heights) = (Vec::new(), Vec::new());
    let (mut ceilings, mut tops) = (Vec::new(), Vec::new());
    for (&(index, grid), farthest) in all.iter().zip(farthest) {
        let piece = pieces.iter().find(|piece| piece.shape == index);
        let solid = &piece.expect("every field is a piece").solid;
        let [dx, dy] = grid.cell();
        // its centre in its own axes, from the world's origin
        let center: [f64; 3] =
            std::array::from_fn(|i| (0..3).map(|k| solid.axes[i][k] * solid.center[k]).sum());
        let base = [
            center[0] - grid.half[0],
            center[1] - grid.half[1],
            center[2],
        ];
        let length = libm::hypot(dx, dy);
        let extent = (0..2).map(|i| base[i].abs() + 2.0 * grid.half[i]);
        let mut row = [0.0; field::LEN];
        row[field::BASE..][..3].copy_from_slice(&base);
        row[field::CELL..][..2].copy_from_slice(&[dx, dy]);
        row[field::INVERSE..][..2].copy_from_slice(&[1.0 / dx, 1.0 / dy]);
        row[field::CELLS..][..2]
            .copy_from_slice(&[grid.columns - 1, grid.rows - 1].map(|n| n as f64));
        row[field::FIRST] = heights.len() as f64;
        row[field::BOTTOM] = grid.bottom;
        row[field::EXTENT] = extent.fold(0.0, f64::max);
        row[field::TILES_FIRST] = ceilings.len() as f64;
        row[field::TILES] = (grid.columns - 1).div_ceil(TILE) as f64;
        row[field::ACROSS..][..2].copy_from_slice(&[dy / length, -dx / length]);
        row[field::DIAGONAL] = 1.0 / (dx * dx + dy * dy);
        sizes.extend(row);
        heights.extend(&grid.elevations);
        ceilings.extend(highest(grid, farthest));
        tops.extend(highest_corners(grid));
    }
    let cells_max = under.iter().max().map_or(0, |&most| most as usize);
    let memory = &mut contacts.memory;
    memory.field_cells = Table {
        base: memory.len,
        stride: 1,
        rows: cells_max.max(1),
    };
    memory.len += memory.field_cells.rows.next_multiple_of(4);
    let tables = &mut contacts.tables;
    let mut numbers = |stride: usize, new: Vec<f64>| {
        let (base, rows) = (tables.numbers.len(), new.len() / stride);
        tables.numbers.extend(new);
        Fixed { base, stride, rows }
    };
    // what does not fit in the list of a pair is counted; a prism gives few points
    contacts.may_overflow |= 2 * cells_max * POINTS_OF_A_PRISM > FIELD_CANDIDATES;
    contacts.fields = FieldTables {
        heights: numbers(1, heights),
        ceilings: numbers(1, ceilings),
        tops: numbers(1, tops),
        sizes: numbers(field::LEN, sizes),
        cells: Fixed {
            base: contacts.tables.indices.len(),
            stride: 1,
            rows: under.len(),
        },
        cells_max,
    };
    contacts.tables.indices.extend(under);
    Ok(())
}

/// The highest corner of the cell that begins at each sample; of those past the last cell, the sample itself.
fn highest_corners(field: &HeightField) -> Vec<f64> {
    let [columns, rows] = [field.columns, field.rows];
    let (mut all, heights) = (field.elevations.to_vec(), &field.elevations);
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let at = row * columns + column;
            all[at] = [at + 1, at + columns, at + columns + 1]
                .iter()
                .fold(heights[at], |top, &k| top.max(heights[k]));
        }
    }
    all
}

/// The highest elevation around each tile, as far as a shape with its centre in the tile reaches.
fn highest(field: &HeightField, reach: f64) -> Vec<f64> {
    let cell = field.cell();
    let [columns, rows] = [field.columns, field.rows];
    // one more for rounding
    let halo = |axis: usize| ((reach / cell[axis]).ceil() as usize).saturating_add(1);
    let window = |tile: usize, axis: usize, samples: usize| {
        let first = (tile * TILE).saturating_sub(halo(axis));
        first
            ..((tile + 1) * TILE)
                .saturating_add(halo(axis) + 1)
                .min(samples)
    };
    // along x first, then along y
    let tiles = [columns - 1, rows - 1].map(|cells| cells.div_ceil(TILE));
    let mut lines = vec![f64::NEG_INFINITY; rows * tiles[0]];
    for row in 0..rows {
        for tile in 0..tiles[0] {
            let elevations = &field.elevations[row * columns..][window(tile, 0, columns)];
            lines[row * tiles[0] + tile] =
                elevations.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        }
    }
    let mut all = Vec::with_capacity(tiles[0] * tiles[1]);
    for tile in 0..tiles[1] {
        for column in 0..tiles[0] {
            let maxima = window(tile, 1, rows).map(|row| lines[row * tiles[0] + column]);
            all.push(maxima.fold(f64::NEG_INFINITY, f64::max));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_the_highest_of_its_four_corners() {
        let (rows, columns) = (4, 5);
        let z: Vec<f64> = (0..rows * columns)
            .map(|k| ((k * 37) % 17) as f64)
            .collect();
        let field = HeightField::new([rows, columns], z.clone(), [1.0, 1.0], 1.0).unwrap();
        let tops = highest_corners(&field);
        assert_eq!(tops.len(), z.len());
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let at = row * columns + column;
                let corners = [z[at], z[at + 1], z[at + columns], z[at + columns + 1]];
                assert_eq!(tops[at], corners.into_iter().fold(0.0, f64::max));
            }
        }
    }

    #[test]
    fn no_sample_within_reach_is_above_the_highest() {
        let (rows, columns) = (13, 18);
        let elevations = (0..rows * columns).map(|k| ((k * 7919) % 101) as f64 * 0.01);
        let field = HeightField::new([rows, columns], elevations.collect(), [3.4, 2.4], 1.0);
        let field = field.unwrap();
        let reach = 0.33;
        let all = highest(&field, reach);
        let [dx, dy] = field.cell();
        let tiles = (columns - 1).div_ceil(TILE);
        for row in 0..rows - 1 {
            for column in 0..columns - 1 {
                let bound = all[row / TILE * tiles + column / TILE];
                for (k, &z) in field.elevations.iter().enumerate() {
                    let [x, y] = [(k % columns) as f64, (k / columns) as f64];
                    let beyond = |at: f64, cell: usize, edge: f64| {
                        ((cell as f64 - at).max(at - 1.0 - cell as f64)).max(0.0) * edge
                    };
                    if beyond(x, column, dx) <= reach && beyond(y, row, dy) <= reach {
                        assert!(z <= bound, "sample {k} at {z} above {bound}");
                    }
                }
            }
        }
    }
}
