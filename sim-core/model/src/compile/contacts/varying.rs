//! Tables of pairs that the kernel source reads where surfaces differ from world to world.

use super::pairs::ContactBuilder;
use super::pieces::{PlacedShape, geom_of, named_pair, named_pair_place};
use sim_physics::constants::Impedance;
use sim_physics::constants::contact::{Contacts, mixing, rule};
use sim_physics::lane::Fixed;
use std::cmp::Ordering;

impl ContactBuilder<'_> {
    /// Notes of each pair how the softness of its shapes combines.
    pub(super) fn add_mixing(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        if !contacts.varying.softness {
            return;
        }
        contacts.mixing = Fixed {
            base: contacts.tables.numbers.len(),
            stride: mixing::COLUMNS,
            rows: pairs.len(),
        };
        for &pair in pairs {
            contacts.tables.numbers.extend(self.mixing(pair));
        }
    }

    fn mixing(&self, (a, b): (usize, usize)) -> [f64; mixing::COLUMNS] {
        let [x, y] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        let has_geom = self.geom_pair(x, y).is_some();
        let is_safe = self.has_safe_references() || !has_geom;
        let Impedance {
            d_min,
            d_max,
            inverse_width,
            midpoint,
            ..
        } = self.impedance((a, b));
        let mut row = [0.0; mixing::COLUMNS];
        row[mixing::SHARE] = geom_of(x).share(&geom_of(y));
        row[mixing::RULE] = self.friction_rule((a, b));
        row[mixing::KEEPS_SLIDING] = if has_geom { 0.0 } else { 1.0 };
        row[mixing::LEAST_TIME] = if is_safe { 2.0 * self.scene.dt } else { 0.0 };
        row[mixing::IMPEDANCE..].copy_from_slice(&[d_min, d_max, inverse_width, midpoint]);
        row
    }

    /// Notes of each pair that a model names the row of its friction.
    pub(super) fn add_named_pairs(&self, contacts: &mut Contacts<f64>, pairs: &[(usize, usize)]) {
        if !contacts.varying.pairs {
            return;
        }
        contacts.named_pairs = Fixed {
            base: contacts.tables.indices.len(),
            stride: 1,
            rows: pairs.len(),
        };
        let rows = pairs.iter().map(|&(a, b)| {
            let [a, b] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
            let place = named_pair_place(a, b, self.rules);
            let row = place.map_or(0, |place| self.pieces.len() + place);
            u32::try_from(row).expect("models have fewer pairs than that")
        });
        contacts.tables.indices.extend(rows);
    }

    /// Whose friction counts for a pair: MuJoCo's rule for its geoms, that of the scene for others.
    pub(super) fn friction_rule(&self, (a, b): (usize, usize)) -> f64 {
        let [a, b] = [a, b].map(|piece| &self.shapes[self.pieces[piece].shape]);
        if self.geom_pair(a, b).is_none() {
            return rule::COMBINED;
        }
        if self.is_overridden(a, b) {
            return rule::FIXED;
        }
        if named_pair(a, b, self.rules).is_some() {
            return rule::OWN;
        }
        let [first, second] = [a, b].map(PlacedShape::priority);
        match first.cmp(&second) {
            Ordering::Equal => rule::LARGER,
            Ordering::Greater => rule::FIRST,
            Ordering::Less => rule::SECOND,
        }
    }
}
