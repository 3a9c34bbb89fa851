//! A prism of a height field: what lies below a triangle of its surface, in the field's axes, from the centre of a shape.
//!
//! ```text
//! y ↑  K ── Q        P Q  the diagonal of a cell, in both of its prisms
//!   |  |  ╱ |        K    the third corner: upper left where `side` is 1, lower right where it is -1
//!   |  P ── K
//!   └────────→ x     Its sides are vertical, so their normals have no z.
//! ```

use super::hull_axes::{Reach, SeparatingAxis};
use super::restart::Extent;
use super::select::select;
use super::support::Support;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};

/// Squared lengths count as at least this [m²].
const TINY: f64 = 1e-30;
/// Squared sine below which an edge lies along an axis of the other shape: their common normal is that of a face.
const ALONG: f64 = 1e-6;

/// A prism.
#[derive(Clone, Copy)]
pub(super) struct Prism<F> {
    /// P, Q and K.
    pub top: [Vec3<F>; 3],
    /// Height of its bottom [m].
    pub bottom: F,
    /// 1 for the upper left prism of a cell, -1 for the lower right one.
    pub side: F,
    /// Outward unit normal of the side below the diagonal.
    pub across: [F; 2],
    /// Outward unit normal of the top.
    pub up: Vec3<F>,
}

/// The place of a prism that is nearest to a point.
#[derive(Clone, Copy)]
pub(super) struct Nearest<F> {
    /// The place [m].
    pub place: Vec3<F>,
    /// Unit vector from the prism to the point.
    pub normal: Vec3<F>,
    /// Distance of the point, negative inside [m].
    pub distance: F,
}

/// The best separating axis of a prism and another shape, and the features it belongs to.
pub(super) struct PrismAxis<F> {
    /// The best that may be the way out, from the other shape to the prism.
    pub axis: SeparatingAxis<F>,
    /// The distance along the best of all axes [m].
    pub gap: F,
    /// 0: normal of a face of the prism; 1: of a face of the other; 2: of two edges.
    pub kind: F,
    /// A point of the prism's edge, and its unit direction.
    pub edge: [Vec3<F>; 2],
    /// Unit direction of the other's edge.
    pub other: Vec3<F>,
}

impl<F: Num> PrismAxis<F> {
    /// Takes an axis if it is better by the tolerance and faces the top enough; returns whether.
    #[inline(always)]
    fn offer(
        &mut self,
        normal: Vec3<F>,
        distance: F,
        up: Vec3<F>,
        [tolerance, facing]: [F; 2],
    ) -> F::Mask {
        let is = (self.axis.distance + tolerance).lt(distance) & facing.lt(-normal.dot(up));
        self.axis.normal = select(is, normal, self.axis.normal);
        self.axis.distance = F::select(is, distance, self.axis.distance);
        self.gap = self.gap.max(distance);
        is
    }
}

impl<F: Num> Nearest<F> {
    /// The place that a point at the given way from it may be nearest to.
    #[inline(always)]
    fn offer(&mut self, place: Vec3<F>, x: Vec3<F>) {
        let way = x - place;
        let distance = way.dot(way).sqrt();
        // no distance has no direction: another place stands for it
        let closer = distance.lt(self.distance) & F::c(TINY).lt(distance);
        let unit = F::c(1.0).div(distance.max(F::c(TINY)));
        self.place = select(closer, place, self.place);
        self.normal = select(closer, way * unit, self.normal);
        self.distance = F::select(closer, distance, self.distance);
    }

    /// The nearer of two.
    #[inline(always)]
    pub fn or(self, other: Nearest<F>) -> Nearest<F> {
        let closer = other.distance.lt(self.distance);
        Nearest {
            place: select(closer, other.place, self.place),
            normal: select(closer, other.normal, self.normal),
            distance: F::select(closer, other.distance, self.distance),
        }
    }
}

impl<F: Num> Prism<F> {
    /// A prism by the corners of its top.
    #[inline(always)]
    pub fn new(top: [Vec3<F>; 3], bottom: F, side: F, diagonal: [F; 2]) -> Prism<F> {
        let up = (top[1] - top[0]).cross(top[2] - top[0]) * side;
        let unit = F::c(1.0).div(up.dot(up).sqrt());
        Prism {
            top,
            bottom,
            side,
            across: [diagonal[0] * side, diagonal[1] * side],
            up: up * unit,
        }
    }

    /// The normals of its faces: the top, three sides, the bottom.
    #[inline(always)]
    pub fn normals(&self) -> [Vec3<F>; 5] {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        [
            self.up,
            Vec3([-self.side, zero, zero]),
            Vec3([zero, self.side, zero]),
            Vec3([self.across[0], self.across[1], zero]),
            Vec3([zero, zero, -one]),
        ]
    }

    /// How far a point lies beyond each of its faces [m].
    #[inline(always)]
    pub fn beyond(&self, x: Vec3<F>) -> [F; 5] {
        let [p, _, k] = self.top;
        let (from_p, from_k) = (x - p, x - k);
        [
            self.up.dot(from_p),
            -(self.side * from_k[0]),
            self.side * from_k[1],
            self.across[0].fma(from_p[0], self.across[1] * from_p[1]),
            self.bottom - x[2],
        ]
    }

    /// The place nearest to a point. From inside, the way out is through the nearest face.
    #[inline(always)]
    pub fn nearest(&self, x: Vec3<F>) -> Nearest<F> {
        let zero = F::c(0.0);
        let (beyond, normals) = (self.beyond(x), self.normals());
        let mut out = Nearest {
            place: normals[0].scale_add(-beyond[0], x),
            normal: normals[0],
            distance: beyond[0],
        };
        for (normal, distance) in normals.into_iter().zip(beyond).skip(1) {
            let nearer = out.distance.lt(distance);
            out.place = select(nearer, normal.scale_add(-distance, x), out.place);
            out.normal = select(nearer, normal, out.normal);
            out.distance = F::select(nearer, distance, out.distance);
        }
        let inside = !zero.lt(out.distance);
        let other = self.nearest_outside(x, beyond);
        Nearest {
            place: select(inside, out.place, other.place),
            normal: select(inside, out.normal, other.normal),
            distance: F::select(inside, out.distance, other.distance),
        }
    }

    /// The place of its surface that is nearest to a point outside: on the top, on an edge of the top, on a side or an edge
    /// below it, on the bottom.
    #[inline(always)]
    fn nearest_outside(&self, x: Vec3<F>, beyond: [F; 5]) -> Nearest<F> {
        let c = F::c;
        let (zero, far) = (c(0.0), c(1e18));
        let above = self.up.scale_add(-beyond[0], x);
        let foot = self.beyond(above);
        let on_top = !zero.lt(foot[1].max(foot[2]).max(foot[3])) & !beyond[0].lt(zero);
        let mut found = Nearest {
            place: above,
            normal: self.up,
            distance: F::select(on_top, beyond[0], far),
        };
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let (a, b) = (self.top[i], self.top[j]);
            let (edge, way) = (b - a, x - a);
            let flat = edge[0].fma(edge[0], edge[1] * edge[1]);
            let along = edge[0].fma(way[0], edge[1] * way[1]);
            let share = edge.dot(way).div(edge.dot(edge)).max(zero).min(c(1.0));
            found.offer(edge.scale_add(share, a), x);
            // the same height on the side below the edge
            let share = along.div(flat).max(zero).min(c(1.0));
            let Vec3([u, v, height]) = edge.scale_add(share, a);
            found.offer(Vec3([u, v, x[2].max(self.bottom).min(height)]), x);
        }
        let below = !zero.lt(beyond[1].max(beyond[2]).max(beyond[3])) & zero.lt(beyond[4]);
        let place = Vec3([x[0], x[1], F::select(below, self.bottom, far)]);
        found.offer(place, x);
        found
    }

    /// The places of a segment and of the prism's edges that are nearest to each other; the normal is from the edge to the
    /// segment. The segment reaches from `-half` to `half`.
    #[inline(always)]
    pub fn nearest_of_edges(&self, half: Vec3<F>) -> Nearest<F> {
        let mut found = Nearest {
            place: Vec3::zero(),
            normal: self.up,
            distance: F::c(1e18),
        };
        for [a, edge] in self.edges() {
            let (s, t) = nearest_shares(half, a, edge);
            found.offer(edge.scale_add(t, a), half * s);
        }
        found
    }

    /// Edges of the top, then those below its corners: one end, and the way to the other.
    #[inline(always)]
    fn edges(&self) -> [[Vec3<F>; 2]; 6] {
        let [p, q, k] = self.top;
        let down = |a: Vec3<F>| Vec3([F::c(0.0), F::c(0.0), self.bottom - a[2]]);
        [
            [p, q - p],
            [q, k - q],
            [k, p - k],
            [p, down(p)],
            [q, down(q)],
            [k, down(k)],
        ]
    }

    /// Its least and greatest reach along a direction.
    #[inline(always)]
    pub fn span(&self, d: Vec3<F>) -> [F; 2] {
        let level = d[2] * self.bottom;
        let (mut low, mut high) = (F::c(1e18), F::c(-1e18));
        for a in self.top {
            let flat = d[0].fma(a[0], d[1] * a[1]);
            let (upper, lower) = (d[2].fma(a[2], flat), flat + level);
            low = low.min(upper).min(lower);
            high = high.max(upper).max(lower);
        }
        [low, high]
    }

    /// The best of its faces, the other's faces and the pairs of edges: in penetration that is exact. Edges of its bottom are left
    /// out. The other shape has the given axes, and its centre is the origin.
    ///
    /// Only normals whose cosine to the top's is at least `facing` are the way out: see [`super::prisms`].
    #[inline(always)]
    pub fn best_axis<R: Reach<F>>(
        &self,
        axes: &Mat3<F>,
        other: &R,
        tolerance: F,
        facing: f64,
    ) -> PrismAxis<F> {
        let (zero, beyond) = (F::c(0.0), self.beyond(Vec3::zero()));
        let distance = beyond[0] - other.reach(axes.transpose_mul(self.up));
        let mut best = PrismAxis {
            axis: SeparatingAxis {
                normal: -self.up,
                distance,
            },
            gap: distance,
            kind: zero,
            edge: [Vec3::zero(); 2],
            other: Vec3::zero(),
        };
        let limits = [tolerance, F::c(facing)];
        for (m, distance) in self.normals().into_iter().zip(beyond).skip(1) {
            let distance = distance - other.reach(axes.transpose_mul(m));
            best.offer(-m, distance, self.up, limits);
        }
        for &j in R::FACES {
            let mut unit = [zero; 3];
            unit[j] = F::c(1.0);
            let (half, [low, high]) = (other.reach(Vec3(unit)), self.span(axes[j]));
            for (n, distance) in [(axes[j], low - half), (-axes[j], -high - half)] {
                let is = best.offer(n, distance, self.up, limits);
                best.kind = F::select(is, F::c(1.0), best.kind);
            }
        }
        for &j in R::EDGES {
            // the edges below its corners are parallel: one axis for all three
            for (i, [a, way]) in self.edges().into_iter().take(4).enumerate() {
                self.offer_edges(axes, other, limits, (a, way, i < 3), j, &mut best);
            }
        }
        best
    }

    /// Takes the common normal of an edge and an axis of the other shape if it is better.
    #[inline(always)]
    fn offer_edges<R: Reach<F>>(
        &self,
        axes: &Mat3<F>,
        other: &R,
        limits: [F; 2],
        (a, way, is_top): (Vec3<F>, Vec3<F>, bool),
        j: usize,
        best: &mut PrismAxis<F>,
    ) {
        let (c, q) = (F::c, axes[j]);
        let along = match is_top {
            true => way * c(1.0).div(way.dot(way).sqrt()),
            false => Vec3([c(0.0), c(0.0), c(-1.0)]),
        };
        let normal = along.cross(q);
        let square = normal.dot(normal);
        let unit = c(1.0).div(square.max(c(ALONG)).sqrt());
        let normal = normal * unit;
        let ([low, high], half) = (self.span(normal), other.reach(axes.transpose_mul(normal)));
        // along the normal, and against it: a shape may have passed the edge. Of parallel ones the normal is that of a face
        let parallel = square.lt(c(ALONG));
        let far = c(-1e18);
        for (n, distance) in [(normal, low - half), (-normal, -high - half)] {
            let distance = F::select(parallel, far, distance);
            let is = best.offer(n, distance, self.up, limits);
            let a = match is_top {
                true => a,
                false => self.nearest_corner(n),
            };
            best.kind = F::select(is, c(2.0), best.kind);
            best.edge[0] = select(is, a, best.edge[0]);
            best.edge[1] = select(is, along, best.edge[1]);
            best.other = select(is, q, best.other);
        }
    }

    /// The corner of its top that is least along a level direction.
    #[inline(always)]
    fn nearest_corner(&self, d: Vec3<F>) -> Vec3<F> {
        let [p, q, k] = self.top;
        let best = select(q.dot(d).lt(p.dot(d)), q, p);
        select(k.dot(d).lt(best.dot(d)), k, best)
    }

    /// The radius of a ball about the middle of its top that holds the top [m].
    #[inline(always)]
    pub fn radius(&self) -> F {
        let [p, q, _] = self.top;
        let flat = q - p;
        flat.dot(flat).sqrt()
    }
}

/// Shares of a segment from `-half` to `half`, and of an edge from `a`, at which they are nearest (Ericson 2005, 5.1.9): -1 to 1
/// and 0 to 1.
#[inline(always)]
fn nearest_shares<F: Num>(half: Vec3<F>, a: Vec3<F>, edge: Vec3<F>) -> (F, F) {
    let c = F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let (hh, he, ee) = (
        half.dot(half).max(c(TINY)),
        half.dot(edge),
        edge.dot(edge).max(c(TINY)),
    );
    let (ha, ea) = (half.dot(a), edge.dot(a));
    let square = he.fnma(he, hh * ee);
    // of parallel ones any place will do
    let s = ee.fma(ha, -(he * ea)).div(square.max(hh * ee * c(1e-12)));
    let s = s.max(-one).min(one);
    let t = he.fma(s, -ea).div(ee).max(zero).min(one);
    let s = he.fma(t, ha).div(hh).max(-one).min(one);
    (s, t)
}

impl<C: Cx> Support<C> for Prism<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        let is_down = d[2].lt(C::F::c(0.0));
        let corner = |a: Vec3<C::F>| Vec3([a[0], a[1], C::F::select(is_down, self.bottom, a[2])]);
        let [p, q, k] = self.top;
        let (p, q, k) = (corner(p), corner(q), corner(k));
        let second = p.dot(d).lt(q.dot(d));
        let best = select(second, q, p);
        select(best.dot(d).lt(k.dot(d)), k, best)
    }
}

impl<C: Cx> Extent<C> for Prism<C::F> {
    #[inline(always)]
    fn extent(&self, _: &mut C, d: Vec3<C::F>) -> C::F {
        self.span(d)[1]
    }
}
