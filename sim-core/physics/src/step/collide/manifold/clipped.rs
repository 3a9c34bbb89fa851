//! Contact points of two shapes whose normal is known: a feature of one is clipped by a feature of the other.
//!
//! Both features are seen along the normal n, as polygons in the plane across it, each with its height along n (Sutherland
//! and Hodgman 1974; MuJoCo: `mjc_ConvexConvex` with `multiccd`). The corners of the polygons' intersection are candidates,
//! and the difference of the heights is their distance. It is never less than the shapes' distance along n, so no candidate
//! is too deep. Where no candidate is as deep as the shapes, the pair's closest point is added. Of more than four candidates,
//! the deepest and the three that span most are kept (see [`super::reduction`]).

use super::clip::{Clip, ClipPlane, NO_CANDIDATE, deepest_candidate, farthest_candidate};
use super::points::Points;
use super::select::perpendicular;
use crate::constants::hull::CORNERS_MAX;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::convex::features::Feature;
use crate::step::collide::convex::support::rounding_error;
use crate::step::collide::narrow::ShapePair;
use crate::step::collide::variables::{get3, set3, var3};
use crate::{break_if, times, when};

/// Features steeper than this against the normal are not clipped [–]: their heights would multiply the errors of a cut.
const FACING: f64 = 0.2;
/// Points nearer to those chosen than this, relative to the smaller shape's radius, do not widen a contact.
const SPREAD: f64 = 1e-3;

/// Where two shapes are nearest.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct Separation<F> {
    /// Unit normal from the pair's first shape to the second.
    pub normal: Vec3<F>,
    /// Their distance along it, negative in penetration [m].
    pub distance: F,
    /// The middle of their closest points [m].
    pub point: Vec3<F>,
}

/// A feature of each shape, one to be clipped by the other.
pub(in crate::step::collide) struct FeaturePair<F: Num, A, B> {
    pub clipped: A,
    pub clipping: B,
    /// 1 where the clipped feature is of the pair's first shape, -1 where it is of the second.
    pub side: F,
    /// The worlds in which the features may touch in more than a point.
    pub flat: F::Mask,
}

/// Variables of the chosen points: across the normal twice, and distance.
struct Chosen<C: Cx> {
    /// The deepest point, then the three that span most.
    spots: [[C::V; 3]; 4],
    /// 1 where the second, third and fourth exist.
    exists: [C::V; 3],
    /// The clipped feature as slopes and base: its height at a point.
    surface: [C::V; 3],
    /// 1 where the first point is the pair's closest one.
    is_closest: C::V,
}

impl<C: Cx> Chosen<C> {
    /// The pair's closest point alone.
    #[inline(always)]
    fn new(cx: &mut C, distance: C::F) -> Self {
        let zero = C::F::c(0.0);
        Chosen {
            spots: [
                var3(cx, Vec3([zero, zero, distance])),
                var3(cx, Vec3([zero; 3])),
                var3(cx, Vec3([zero; 3])),
                var3(cx, Vec3([zero; 3])),
            ],
            exists: [cx.var(zero), cx.var(zero), cx.var(zero)],
            surface: var3(cx, Vec3([zero; 3])),
            is_closest: cx.var(C::F::c(1.0)),
        }
    }
}

/// Adds the contact points of a pair, whose separation and features are in the frame of the second shape.
///
/// `size` is the smaller shape's radius.
#[inline(always)]
pub(in crate::step::collide) fn add_manifold<C: Cx, A: Feature<C>, B: Feature<C>>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    near: &Separation<C::F>,
    features: &FeaturePair<C::F, A, B>,
    size: C::F,
    out: &mut Points<C>,
) {
    // the view: u and v across the normal n, heights along n
    let n = near.normal;
    let u = perpendicular(n);
    let view = Mat3([u, n.cross(u), n]);
    // features that cannot lie flat touch in the closest point alone, as does a pair without candidates
    let mut chosen = Chosen::new(cx, near.distance);
    when!(cx, features.flat, {
        let clip = Clip {
            tables: pair.clip_tables,
            counts: [features.clipped.count(), features.clipping.count()],
            side: features.side,
            size,
            margin: pair.margin,
        };
        // loops end for a world at the corners of its larger polygon
        let most = clip.counts[0].max(clip.counts[1]);
        project(cx, &clip, most, near, features, &view);
        intersect(cx, &clip, features, &view, &mut chosen);
        reduce(cx, &clip, most, near.distance, &mut chosen);
    });
    add_chosen(cx, pair, near, features.side, &view, &chosen, out);
}

/// Writes the corners of both features as seen along the normal, and clears the candidates.
#[inline(always)]
fn project<C: Cx, A: Feature<C>, B: Feature<C>>(
    cx: &mut C,
    clip: &Clip<C::F>,
    most: C::F,
    near: &Separation<C::F>,
    features: &FeaturePair<C::F, A, B>,
    view: &Mat3<C::F>,
) {
    let (c, tables) = (C::F::c, clip.tables);
    // one more row than corners: the first corner again, the end of the last edge
    times!(cx, i in CORNERS_MAX + 1, {
        // corners of both features in the view, from the closest point of the pair
        let p = features.clipped.corner(cx, i);
        let q = features.clipping.corner(cx, i);
        let p = view.transpose_mul(p - near.point);
        let q = view.transpose_mul(q - near.point);
        for k in 0..3 {
            cx.fill(tables.corners, i, k, p[k]);
            cx.fill(tables.corners, i, 3 + k, q[k]);
        }
        let done = (most - c(0.5)).lt(cx.number(i));
        break_if!(cx, done);
        // row i has no candidates yet
        for k in 0..3 {
            cx.fill(tables.candidates, i, 3 * k + 2, c(NO_CANDIDATE));
        }
    });
}

/// Writes the candidates: the corners of the polygons' intersection.
#[inline(always)]
fn intersect<C: Cx, A: Feature<C>, B: Feature<C>>(
    cx: &mut C,
    clip: &Clip<C::F>,
    features: &FeaturePair<C::F, A, B>,
    view: &Mat3<C::F>,
    chosen: &mut Chosen<C>,
) {
    let c = C::F::c;
    let first = cx.at(0);
    // the planes of both polygons: heights along n as linear functions of x and y
    let p = view.transpose_mul(features.clipped.normal());
    let p = ClipPlane::through(cx, clip.tables, first, 0, p);
    let q = view.transpose_mul(features.clipping.normal());
    let q = ClipPlane::through(cx, clip.tables, first, 3, q);
    // the clipped feature's plane gives the height of contact points in `add_chosen`
    let surface = Vec3([p.slope[0], p.slope[1], p.base]);
    set3(cx, &mut chosen.surface, surface);
    clip.half_planes(cx, q.turn);
    // a steep plane leaves no candidates, and the closest point stays alone
    let steep = p.facing.lt(c(FACING)) | q.facing.lt(c(FACING));
    when!(cx, !steep, {
        clip.clip_edges(cx, &q);
        clip.add_corners_inside(cx, &p);
    });
}

/// Chooses four of the candidates.
#[inline(always)]
fn reduce<C: Cx>(
    cx: &mut C,
    clip: &Clip<C::F>,
    most: C::F,
    distance: C::F,
    chosen: &mut Chosen<C>,
) {
    // candidates as deep as the shapes up to rounding are as deep
    let least = rounding_error::<C::F>() * clip.size;
    let (x, deep) = deepest_candidate(cx, clip.tables, most, least, distance);
    // the deepest candidate replaces the closest point, if it is as deep as the shapes are
    let old = get3(cx, &chosen.spots[0]);
    set3(cx, &mut chosen.spots[0], select(deep, x, old));
    let is_closest = C::F::select(deep, C::F::c(0.0), C::F::c(1.0));
    cx.set(&mut chosen.is_closest, is_closest);
    // second to fourth point: each adds most to those before, and at least SPREAD of the radius
    for count in 0..3 {
        let spots = [
            get3(cx, &chosen.spots[0]),
            get3(cx, &chosen.spots[1]),
            get3(cx, &chosen.spots[2]),
        ];
        let least = C::F::c(SPREAD) * clip.size;
        let (x, is) = farthest_candidate(cx, clip.tables, most, count, spots, least);
        set3(cx, &mut chosen.spots[count + 1], x);
        cx.set(&mut chosen.exists[count], is);
    }
}

/// Adds the chosen points, half-way between the surfaces, in the frame of the pair.
#[inline(always)]
fn add_chosen<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    near: &Separation<C::F>,
    side: C::F,
    view: &Mat3<C::F>,
    chosen: &Chosen<C>,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (Mat3([u, v, n]), frame) = (*view, pair.pose_b);
    // the normal in the frame of the pair
    let normal = frame.axes * n;
    let slope = get3(cx, &chosen.surface);
    for k in 0..4 {
        let Vec3([x, y, distance]) = get3(cx, &chosen.spots[k]);
        // rounding of the cut must not make a candidate deeper than the shapes are
        let distance = distance.max(near.distance);
        // the middle: height of the clipped surface plus half the way to the other, which `side` gives a sign
        let height = slope[0].fma(x, slope[1].fma(y, slope[2])) + distance * side * c(0.5);
        // the closest point is a middle already
        let height = match k {
            0 => C::F::select(c(0.5).lt(cx.get(&chosen.is_closest)), c(0.0), height),
            _ => height,
        };
        // from the view to the frame of the second shape, then to that of the pair
        let point = u.scale_add(x, v.scale_add(y, n.scale_add(height, near.point)));
        let point = frame.axes.mul_add(point, frame.center);
        // the first point exists within the margin, the others where they widened the contact
        let is = match k {
            0 => distance.lt(pair.margin),
            _ => c(0.5).lt(cx.get(&chosen.exists[k - 1])),
        };
        out.add(cx, is, point, distance, normal);
    }
}
