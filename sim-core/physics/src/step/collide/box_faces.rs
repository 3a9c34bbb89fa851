//! The face of a box cut to a face of another box.

use super::boxes::Axis;
use super::choose::{reciprocal, select, sign, steepest, turned, turned_numbers};
use super::points::{Placed, Points};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::{Mat3, Vec3};

/// The reference rectangle is larger by this, relatively, in roundings, so that equal faces keep their corners.
const INCLUSIVE: f64 = 16.0;
/// A reference corner counts that far inside the incident face: a little less than the above. So a corner may count twice
/// if it lies within these few roundings, but none is lost between the two.
const INTERIOR: f64 = 14.0;

/// Two faces seen along the normal of one, the reference. The frame: u, v along its sides, and the normal.
pub struct View<F> {
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

/// The faces of the best face axis.
#[inline(always)]
pub fn view<F: Num>(
    best: &Axis<F>,
    axes_a: &Mat3<F>,
    half_a: Vec3<F>,
    b: &Placed<F>,
    half_b: Vec3<F>,
) -> View<F> {
    let (of_b, e) = (best.of_b, best.number);
    let mut k = best.turn;
    for i in 0..3 {
        for j in 0..3 {
            k[i][j] = F::select(of_b, best.turn[j][i], best.turn[i][j]);
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

    let Mat3([n, u, v]) = turned(e, k);
    let Vec3([tn, tu, tv]) = turned_numbers(e, t);
    let Vec3([hn, hu, hv]) = turned_numbers(e, half);
    let Mat3([an, au, av]) = turned(e, Mat3(axes));
    let side = sign(tn);
    let outwards = an * side;

    let f = steepest(n);
    let Vec3([u0, u1, u2]) = turned_numbers(f, u);
    let Vec3([v0, v1, v2]) = turned_numbers(f, v);
    let Vec3([n0, n1, n2]) = turned_numbers(f, n * side);
    let Vec3([g0, g1, g2]) = turned_numbers(f, other);
    let down = sign(n0) * g0;
    View {
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

/// The incident face cut to the reference rectangle, twelve candidates: where each incident edge enters, where it
/// leaves if it was cut, and the corners of the reference face inside the incident one. Returns the least distance.
#[inline(always)]
pub fn cut<C: Cx>(cx: &mut C, view: &View<C::F>, margin: C::F, out: &mut Points<C>) -> C::F {
    let c = C::F::c;
    let one = c(1.0);
    let [hu, hv] = view.sides;
    let rounding = <C::F as Num>::Real::EPSILON;
    let wider = c(INCLUSIVE * rounding);
    let interior = c(1.0 - INTERIOR * rounding);
    let (wide_u, wide_v) = (hu.fma(wider, hu), hv.fma(wider, hv));
    let [e1, e2] = view.edges;
    let middle = view.middle;
    let mut least = c(1e9);
    for (across, run, sense) in [(e2, e1, -1.0), (e1, e2, 1.0)] {
        let (x, y) = (reciprocal(run[0]), reciprocal(run[1]));
        let (wx, wy) = (wide_u * x.abs(), wide_v * y.abs());
        for s in [-1.0, 1.0] {
            let start = across.scale_add(c(s), middle);
            let (at_x, at_y) = (start[0] * x, start[1] * y);
            let low = (-at_x - wx).max(-at_y - wy).max(-one);
            let high = (wx - at_x).min(wy - at_y).min(one);
            let inside = low.lt(high);
            // round the face each edge ends where the next one starts
            let (enter, leave, is_cut) = match s == sense {
                true => (low, high, high.lt(one)),
                false => (high, low, (-one).lt(low)),
            };
            let is_cut = inside & is_cut;
            let (enter, leave) = (run.scale_add(enter, start), run.scale_add(leave, start));
            point(cx, view, inside, enter, margin, &mut least, out);
            point(cx, view, is_cut, leave, margin, &mut least, out);
        }
    }
    let inverse = one.div(e1[1].fnma(e2[0], e1[0] * e2[1]));
    for (x, y) in [(-hu, -hv), (hu, -hv), (-hu, hv), (hu, hv)] {
        let (dx, dy) = (x - middle[0], y - middle[1]);
        let along1 = dy.fnma(e2[0], dx * e2[1]) * inverse;
        let along2 = dx.fnma(e1[1], dy * e1[0]) * inverse;
        let inside = along1.abs().lt(interior) & along2.abs().lt(interior);
        let height = along1.fma(e1[2], along2.fma(e2[2], middle[2]));
        point(
            cx,
            view,
            inside,
            Vec3([x, y, height]),
            margin,
            &mut least,
            out,
        );
    }
    least
}

/// Adds a point of the frame, at a distance above the reference face.
#[inline(always)]
fn point<C: Cx>(
    cx: &mut C,
    view: &View<C::F>,
    mask: MaskOf<C>,
    at: Vec3<C::F>,
    margin: C::F,
    least: &mut C::F,
    out: &mut Points<C>,
) {
    let mask = mask & at[2].lt(margin);
    *least = C::F::select(mask, least.min(at[2]), *least);
    let up = view.outwards.scale_add(at[2] * C::F::c(0.5), view.origin);
    let position = view.axes[0].scale_add(at[0], view.axes[1].scale_add(at[1], up));
    out.add(cx, mask, position, at[2], view.normal);
}
