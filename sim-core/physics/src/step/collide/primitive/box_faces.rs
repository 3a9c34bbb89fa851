//! The face of a box clipped to a face of another box.
//!
//! The clipping face is a rectangle along u and v, so clipping an edge is an interval per axis (Liang and Barsky 1984).

use super::boxes::BoxAxis;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::{
    cycle_columns, cycle_components, largest_axis, reciprocal, sign,
};
use crate::step::collide::narrow::ShapePair;

/// Relative growth of the reference rectangle, in roundings, so that equal faces keep their corners.
const INCLUSIVE: f64 = 16.0;
/// Relative shrinking of the incident face for corners of the reference face, in roundings: a little less than the growth.
/// A corner within these few roundings may count twice, but none is lost.
const INTERIOR: f64 = 14.0;

/// Two faces in the frame of one of them, the reference: u, v along its sides, and its outward normal.
pub struct FacePair<F> {
    /// Half sides of the reference face [m].
    sides: [F; 2],
    /// Centre of the incident face, and half its sides [m].
    middle: Vec3<F>,
    edges: [Vec3<F>; 2],
    /// Centre and axes of the reference face, relative to the centre of A.
    origin: Vec3<F>,
    axes: [Vec3<F>; 2],
    /// From the reference face outwards; from A to B.
    outwards: Vec3<F>,
    normal: Vec3<F>,
}

impl<F: Num> FacePair<F> {
    /// The faces of the best face axis.
    #[inline(always)]
    pub fn from_axis<C: Cx<F = F>>(pair: &ShapePair<'_, C>, best: &BoxAxis<F>) -> FacePair<F> {
        let (axes_a, b) = (pair.axes_a, pair.pose_b);
        let (half_a, half_b) = (pair.a.half_extents(), pair.b.half_extents());
        // cosines, centre and sizes as the box of the reference face has them
        let (of_b, e) = (best.of_b, best.index);
        let mut k = best.cosines;
        for i in 0..3 {
            for j in 0..3 {
                k[i][j] = F::select(of_b, best.cosines[j][i], best.cosines[i][j]);
            }
        }
        let [in_a, in_b] = best.center;
        let t = select(of_b, Vec3([-in_b[0], -in_b[1], -in_b[2]]), in_a);
        let half = select(of_b, half_b, half_a);
        let other = select(of_b, half_a, half_b);
        let axes = [
            select(of_b, b.axes[0], axes_a[0]),
            select(of_b, b.axes[1], axes_a[1]),
            select(of_b, b.axes[2], axes_a[2]),
        ];
        let base = select(of_b, b.center, Vec3([F::c(0.0); 3]));

        // the reference axis first, then u and v
        let Mat3([n, u, v]) = cycle_columns(e, k);
        let Vec3([tn, tu, tv]) = cycle_components(e, t);
        let Vec3([hn, hu, hv]) = cycle_components(e, half);
        let Mat3([an, au, av]) = cycle_columns(e, Mat3(axes));
        let side = sign(tn);
        let outwards = an * side;

        // the incident face: across the axis that is most parallel to the normal
        let f = largest_axis(n);
        let Vec3([u0, u1, u2]) = cycle_components(f, u);
        let Vec3([v0, v1, v2]) = cycle_components(f, v);
        let Vec3([n0, n1, n2]) = cycle_components(f, n * side);
        let Vec3([g0, g1, g2]) = cycle_components(f, other);
        // its centre lies g0 against the normal from that of its box; heights count from the reference face
        let down = sign(n0) * g0;
        FacePair {
            sides: [hu, hv],
            middle: Vec3([
                down.fnma(u0, tu),
                down.fnma(v0, tv),
                down.fnma(n0, tn * side) - hn,
            ]),
            edges: [
                Vec3([u1 * g1, v1 * g1, n1 * g1]),
                Vec3([u2 * g2, v2 * g2, n2 * g2]),
            ],
            origin: outwards.scale_add(hn, base),
            axes: [au, av],
            outwards,
            normal: (outwards * F::select(of_b, F::c(-1.0), F::c(1.0))),
        }
    }

    /// Adds the points of the incident face clipped to the reference rectangle.
    ///
    /// There are twelve candidates: where each incident edge enters, where it leaves if it was cut, and the corners of the
    /// reference face inside the incident one. `ordered` edges are in MuJoCo's order.
    #[inline(always)]
    pub fn add_clipped<C: Cx<F = F>>(
        &self,
        cx: &mut C,
        margin: F,
        ordered: bool,
        out: &mut Points<C>,
    ) {
        let c = F::c;
        let one = c(1.0);
        // the reference rectangle a little larger, the incident one a little smaller, so equal faces agree
        let [hu, hv] = self.sides;
        let rounding = F::Real::EPSILON;
        let wider = c(INCLUSIVE * rounding);
        let interior = c(1.0 - INTERIOR * rounding);
        let (wide_u, wide_v) = (hu.fma(wider, hu), hv.fma(wider, hv));
        let [e1, e2] = self.edges;
        let middle = self.middle;
        // an incident edge is start + t run with |t| ≤ 1, at either end of the other direction
        for (along_first, s) in edge_order(ordered) {
            let (across, run, sense) = match along_first {
                true => (e2, e1, -1.0),
                false => (e1, e2, 1.0),
            };
            let (x, y) = (reciprocal(run[0]), reciprocal(run[1]));
            // |start + t run| ≤ side along u and v bounds t; no interval is left where low ≥ high
            let (wx, wy) = (wide_u * x.abs(), wide_v * y.abs());
            let start = across.scale_add(c(s), middle);
            let (at_x, at_y) = (start[0] * x, start[1] * y);
            let low = (-at_x - wx).max(-at_y - wy).max(-one);
            let high = (wx - at_x).min(wy - at_y).min(one);
            let inside = low.lt(high);
            // around the face each edge ends where the next one starts
            let (enter, leave, is_cut) = match s == sense {
                true => (low, high, high.lt(one)),
                false => (high, low, (-one).lt(low)),
            };
            let is_cut = inside & is_cut;
            let (enter, leave) = (run.scale_add(enter, start), run.scale_add(leave, start));
            // candidates count up to the margin above the reference face
            self.add(cx, inside & enter[2].lt(margin), enter, out);
            self.add(cx, is_cut & leave[2].lt(margin), leave, out);
        }
        // corners of the reference face in the coordinates of the incident one (Cramer's rule)
        let inverse = one.div(e1[1].fnma(e2[0], e1[0] * e2[1]));
        for (x, y) in [(-hu, -hv), (hu, -hv), (-hu, hv), (hu, hv)] {
            // a corner counts inside the incident face, at the height of that face above it
            let (dx, dy) = (x - middle[0], y - middle[1]);
            let along1 = dy.fnma(e2[0], dx * e2[1]) * inverse;
            let along2 = dx.fnma(e1[1], dy * e1[0]) * inverse;
            let inside = along1.abs().lt(interior) & along2.abs().lt(interior);
            let height = along1.fma(e1[2], along2.fma(e2[2], middle[2]));
            let at = Vec3([x, y, height]);
            self.add(cx, inside & height.lt(margin), at, out);
        }
    }

    /// Adds a point above the reference face.
    #[inline(always)]
    fn add<C: Cx<F = F>>(&self, cx: &mut C, mask: MaskOf<C>, at: Vec3<F>, out: &mut Points<C>) {
        // half-way between the faces
        let up = self.outwards.scale_add(at[2] * F::c(0.5), self.origin);
        let position = self.axes[0].scale_add(at[0], self.axes[1].scale_add(at[1], up));
        out.add(cx, mask, position, at[2], self.normal);
    }
}

/// The incident edges: whether each runs along the first of its face's axes, and on which side of the other it lies.
#[inline(always)]
fn edge_order(ordered: bool) -> [(bool, f64); 4] {
    match ordered {
        false => [(true, -1.0), (true, 1.0), (false, -1.0), (false, 1.0)],
        // around the face, from the corner on the positive side of both axes
        true => [(true, 1.0), (false, -1.0), (true, -1.0), (false, 1.0)],
    }
}
