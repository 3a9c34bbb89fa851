//! Tables of pairs whose surfaces move beside their shapes, as belts do (MuJoCo: `surfacevel`), and of pairs that adhere.

use super::pairs::{ContactBuilder, rows_of};
use sim_physics::constants::contact::{Cone, Contacts, adhesion, surface_velocity};
use sim_physics::lane::Fixed;
use surface_velocity::{COLUMNS, OF_SHAPE};

impl ContactBuilder<'_> {
    /// Notes how the surfaces of each pair move, if any does.
    pub(super) fn add_surface_velocities(
        &self,
        contacts: &mut Contacts<f64>,
        pairs: &[(usize, usize)],
    ) {
        let rows: Vec<f64> = pairs
            .iter()
            .flat_map(|&(a, b)| [self.surface_velocity(a), self.surface_velocity(b)])
            .flatten()
            .collect();
        if rows.iter().all(|&x| x == 0.0) {
            return;
        }
        contacts.surface_velocities = Fixed {
            base: contacts.tables.numbers.len(),
            stride: COLUMNS,
            rows: pairs.len(),
        };
        contacts.tables.numbers.extend(rows);
    }

    /// Notes the forces by which contacts of each pair pull, if any does.
    pub(super) fn add_adhesion(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        let rows: Vec<_> = pairs.iter().map(|&pair| self.adhesion(pair)).collect();
        if rows.iter().all(|row| row[adhesion::FORCE] == 0.0) {
            return;
        }
        contacts.adhesion = Fixed {
            base: contacts.tables.numbers.len(),
            stride: adhesion::COLUMNS,
            rows: pairs.len(),
        };
        contacts.tables.numbers.extend(rows.as_flattened());
    }

    /// The force by which a contact pulls, by the columns of its table.
    fn adhesion(&self, (a, b): (usize, usize)) -> [f64; adhesion::COLUMNS] {
        let [x, y] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        let Some(geom) = self.geom_pair(x, y) else {
            return [0.0; adhesion::COLUMNS];
        };
        // the edges of a pyramid share it; without friction there are four, which coincide
        let share = |condim: usize| match self.scene.solver.cone {
            Cone::Elliptic => geom.adhesion,
            Cone::Pyramidal if condim == 1 => geom.adhesion / 4.0,
            Cone::Pyramidal => geom.adhesion / rows_of(Cone::Pyramidal, condim) as f64,
        };
        [geom.adhesion, share(geom.condim), share(1)]
    }

    /// How the surface of a piece moves: velocity at its centre, then angular velocity, in its axes.
    fn surface_velocity(&self, piece: usize) -> [f64; OF_SHAPE] {
        let piece = &self.pieces[piece];
        let shape = &self.shapes[piece.shape];
        let Some(geom) = shape.geom else {
            return [0.0; OF_SHAPE];
        };
        // from the geom's origin to the centre, in the axes of both
        let solid = &piece.solid;
        let offset: [f64; 3] = std::array::from_fn(|i| solid.center[i] - shape.pose.pos[i]);
        let [x, y, z] = solid
            .axes
            .map(|axis| axis.iter().zip(offset).map(|(a, o)| a * o).sum::<f64>());
        let [v0, v1, v2, w0, w1, w2] = geom.surface_velocity;
        // v + ω × offset
        [
            v0 + w1 * z - w2 * y,
            v1 + w2 * x - w0 * z,
            v2 + w0 * y - w1 * x,
            w0,
            w1,
            w2,
        ]
    }
}
