//! Rows of joints of a line search where several lanes share a world: each lane has its own.

use super::rows::{Law, bounds, dry_friction, equality, one_sided};
use crate::arrays::Workspace;
use crate::lane::{Cx, Num};
use crate::step::ConstantsOf;

/// A row of each lane of a world: of dry friction, or of a limit. A lane without one has a row that adds nothing.
pub(super) struct OwnRow<F> {
    jar: F,
    /// Change of the residual over the segment.
    pub jv: F,
    weight: F,
    /// Zone and loss of dry friction.
    bounds: Option<[F; 2]>,
    /// The law at α = 0.
    pub start: Law<F>,
}

impl<F: Num> OwnRow<F> {
    /// The law at α of a line.
    pub fn law(&self, alpha: F) -> Law<F> {
        let jar = alpha.fma(self.jv, self.jar);
        match self.bounds {
            Some([zone, loss]) => dry_friction(jar, self.weight, zone, loss),
            None => one_sided(jar, self.weight),
        }
    }
}

/// The rows of dry friction and of limits, of each lane its own; none where a world has one lane.
#[inline(always)]
pub(super) fn own_rows<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    params: &[C::F],
    w: &Workspace<C::F>,
) -> Vec<OwnRow<C::F>> {
    let mut rows = Vec::new();
    if cx.lanes() == 1 {
        return rows;
    }
    let lanes = cx.lanes();
    let (frictions, limits) = (m.equalities.len(), m.equalities.len() + m.frictions.len());
    // a row for each lane, from as many rows that follow each other
    let mut add = |cx: &mut C, part: std::ops::Range<usize>, bounds: Option<[Vec<C::F>; 2]>| {
        let mut by_lane = |values: &[C::F]| cx.own(values);
        let [jar, jv, weight] =
            [&w.jar, &w.jar_minimum, &w.row_weight].map(|values| by_lane(&values[part.clone()]));
        let bounds = bounds.map(|both| both.map(|values| by_lane(&values)));
        // the law at α = 0 needs the other fields, so another one holds its place
        let start = equality(jar, weight);
        let mut row = OwnRow {
            jar,
            jv,
            weight,
            bounds,
            start,
        };
        row.start = row.law(C::F::c(0.0));
        rows.push(row);
    };
    // dry friction, with zone and loss of each lane's row
    for first in (frictions..limits).step_by(lanes) {
        let part = first..limits.min(first + lanes);
        let of_rows = &m.frictions[part.start - frictions..part.end - frictions];
        let both: Vec<_> = of_rows.iter().map(|row| bounds(m, params, row)).collect();
        let both = [0, 1].map(|k| both.iter().map(|row| row[k]).collect());
        add(cx, part, Some(both));
    }
    // limits, whether they act or not: one that does not has weight 0
    for first in (limits..m.joint_rows()).step_by(lanes) {
        add(cx, first..m.joint_rows().min(first + lanes), None);
    }
    rows
}
