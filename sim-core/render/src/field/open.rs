//! Cells from which nothing of their field hides the light.
//!
//! Light from far off stops where it enters a triangle from its front, so only triangles that look away from it hide it. A
//! cell is open where no ray from it to the light comes to such a triangle.

use super::Field;
use crate::vector::{Vector, dot};

/// A cosine below which a triangle is taken to look away from the light [–].
const GRAZING: f32 = 1e-4;
/// Steps along a ray [cells], such that all cells on the way are beside a step's.
const STEP: f32 = 0.45;
/// Steps after which a cell is taken to be not open, however high the field is further on.
const STEPS_MAX: usize = 256;

impl Field {
    /// Finds the open cells, for light from a direction in the field's frame, of length 1.
    pub(crate) fn open_to(&mut self, light: Vector) {
        let [width, height] = self.cells;
        let hiding: Vec<f32> = (0..width * height)
            .map(|cell| match self.looks_away(cell, light) {
                true => self.cell_tops[cell],
                false => f32::NEG_INFINITY,
            })
            .collect();
        let highest = hiding.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let (hiding, size) = (
            around(&hiding, self.cells),
            self.cells.map(|count| count as f32),
        );
        let [by_x, by_y] = [light[0] / self.cell[0], light[1] / self.cell[1]];
        // where the light comes from straight above, one step is all
        let step = (STEP / by_x.abs().max(by_y.abs())).min(f32::MAX);
        let is_open = |cell: usize| {
            let start = [(cell % width) as f32, (cell / width) as f32];
            let (mut along, mut at) = (0.0, start);
            let mut z = self.bottom_of(cell);
            for _ in 0..STEPS_MAX {
                if z >= highest {
                    return true;
                }
                // beside the field, as its last cells
                let [x, y] = [0, 1].map(|k| at[k].clamp(0.0, size[k] - 1.0) as usize);
                if z < hiding[y * width + x] {
                    return false;
                }
                along += step;
                at = [
                    by_x.mul_add(along, start[0]).round(),
                    by_y.mul_add(along, start[1]).round(),
                ];
                if !(0..2).all(|k| (-1.0..=size[k]).contains(&at[k])) {
                    return true;
                }
                z = light[2].mul_add(along, self.bottom_of(cell));
            }
            false
        };
        self.open = match light[2] > 0.0 {
            true => (0..width * height).map(is_open).collect(),
            false => Vec::new(),
        };
    }

    /// Corners of a cell: at low x and y, high x, high y, and both high [m].
    fn corners_of(&self, cell: usize) -> [f32; 4] {
        let place = cell / self.cells[0] * self.columns + cell % self.cells[0];
        [0, 1, self.columns, self.columns + 1].map(|k| self.heights[place + k])
    }

    fn bottom_of(&self, cell: usize) -> f32 {
        self.corners_of(cell).into_iter().fold(f32::MAX, f32::min)
    }

    fn looks_away(&self, cell: usize, light: Vector) -> bool {
        let [low, x, y, both] = self.corners_of(cell);
        let slopes = [[x - low, both - x], [both - y, y - low]];
        slopes.into_iter().any(|[rise_x, rise_y]| {
            let normal = [-rise_x / self.cell[0], -rise_y / self.cell[1], 1.0];
            dot(normal, light) < GRAZING * dot(normal, normal).sqrt()
        })
    }
}

/// The largest values of cells and of those beside them.
fn around(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let near = |place: usize, count: usize| place.saturating_sub(1)..(place + 2).min(count);
    let cells = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let largest = cells.map(|(x, y)| {
        let rows = near(y, height).map(|row| &values[row * width..][near(x, width)]);
        rows.flatten().copied().fold(f32::NEG_INFINITY, f32::max)
    });
    largest.collect()
}

#[cfg(test)]
mod tests {
    use sim_model::geometry::HeightField;

    use super::*;
    use crate::paint::Paint;

    /// Numbers of the cells that are not open along x, of a field that is the same along y; cells are 1 m wide.
    fn hidden(profile: &[f64], light: Vector) -> Vec<usize> {
        let (columns, rows) = (profile.len(), 6);
        let size = [columns - 1, rows - 1].map(|cells| cells as f64);
        let field = HeightField::new([rows, columns], profile.repeat(rows), size, 1.0).unwrap();
        let (mut field, _) = Field::new(&field, &Paint::GROUND);
        let length = dot(light, light).sqrt();
        field.open_to(light.map(|part| part / length));
        let middle = 2 * (columns - 1);
        (0..columns - 1)
            .filter(|x| field.open.get(middle + x) != Some(&true))
            .collect()
    }

    #[test]
    fn slopes_that_face_the_light_hide_nothing() {
        let rough = [0.0, 0.5, 0.2, 0.9, 0.1, 0.4, 0.0];
        assert!(hidden(&rough, [0.6, 0.0, 0.8]).is_empty());
        assert!(hidden(&rough, [0.0, 0.0, 1.0]).is_empty());
        assert_eq!(hidden(&rough, [0.6, 0.0, -0.8]), [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn a_step_hides_as_much_of_what_is_behind_it_as_its_height_lets() {
        // the step down is in cell 3, and light comes over it from low x: 2 m for each metre down
        let step = [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let hidden_cells = hidden(&step, [-2.0, 0.0, 1.0]);
        let needed = [3, 4, 5];
        assert!(
            needed.iter().all(|cell| hidden_cells.contains(cell)),
            "{hidden_cells:?}"
        );
        // beside the step, and a cell more than needed, nothing is known
        let known = [0, 1, 8, 9, 10];
        assert!(
            known.iter().all(|cell| !hidden_cells.contains(cell)),
            "{hidden_cells:?}"
        );
        // from high x the same step is open
        assert!(hidden(&step, [2.0, 0.0, 1.0]).is_empty());
    }
}
