//! A prism of a height field: what lies below a triangle of its surface, in the field's axes, from the centre of a shape.
//!
//! ```text
//! y ↑  K ── Q        P Q  the diagonal of a cell, in both of its prisms
//!   |  |  ╱ |        K    the third corner: upper left where `side` is 1, lower right where it is -1
//!   |  P ── K
//!   └────────→ x     Its sides are vertical, so their normals have no z.
//! ```

use super::restart::Extent;
use super::support::Support;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Vec3, select};

/// Squared lengths count as at least this [m²].
const TINY: f64 = 1e-30;

/// The cells of a field.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct Lattice<F> {
    /// 1 over the edges of a cell [1/m].
    pub inverse: [F; 2],
    /// Unit normal of the diagonals, to the right seen along them [–].
    pub across: [F; 2],
    /// 1 over the squared length of a diagonal, seen from above [1/m²].
    pub diagonal: F,
}

/// A prism.
#[derive(Clone, Copy)]
pub struct Prism<F> {
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
    /// 1 over the squared lengths of PQ, QK and KP, seen from above [1/m²].
    inverse: [F; 3],
}

/// Which prism of its cell one is.
#[derive(Clone, Copy)]
pub(in crate::step::collide) enum Half<M> {
    UpperLeft,
    LowerRight,
    /// The upper left one where the mask holds.
    Of(M),
}

impl<M: Copy> Half<M> {
    /// `left` for the upper left prism, `right` for the other.
    #[inline(always)]
    pub fn pick<F: Num<Mask = M>>(self, left: F, right: F) -> F {
        match self {
            Half::UpperLeft => left,
            Half::LowerRight => right,
            Half::Of(mask) => F::select(mask, left, right),
        }
    }
}

/// The place of a prism that is nearest to a shape's axis or centre.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct Nearest<F> {
    /// The place [m].
    pub place: Vec3<F>,
    /// Unit vector from the prism to the shape.
    pub normal: Vec3<F>,
    /// Their distance, negative inside [m].
    pub distance: F,
}

/// The nearest place so far, by its squared distance: one root for all.
struct Search<F: Num> {
    place: Vec3<F>,
    /// From there to the shape.
    way: Vec3<F>,
    square: F,
    /// Is it on the top? There the way has the top's normal, also without length.
    on_top: F::Mask,
}

impl<F: Num> Search<F> {
    #[inline(always)]
    fn new() -> Search<F> {
        // far < 0 holds nowhere: no place is on the top yet
        let (far, zero) = (F::c(1e36), F::c(0.0));
        Search {
            place: Vec3::zero(),
            way: Vec3::zero(),
            square: far,
            on_top: far.lt(zero),
        }
    }

    /// A place, and the point of the shape that is nearest to it.
    #[inline(always)]
    fn offer(&mut self, place: Vec3<F>, x: Vec3<F>) {
        let way = x - place;
        let square = way.dot(way);
        // no distance has no direction: another place stands for it
        let closer = square.lt(self.square) & F::c(0.0).lt(square);
        self.place = select(closer, place, self.place);
        self.way = select(closer, way, self.way);
        self.square = F::select(closer, square, self.square);
        // a closer place replaces one on the top
        self.on_top = self.on_top & !closer;
    }

    /// The place of an edge of the top that is nearest to a point.
    #[inline(always)]
    fn offer_edge(&mut self, [a, edge]: [Vec3<F>; 2], x: Vec3<F>) {
        // t = e · (x - a)/(e · e), clamped to the edge; an edge of the top has length
        let share = edge.dot(x - a).div(edge.dot(edge));
        let share = share.max(F::c(0.0)).min(F::c(1.0));
        self.offer(edge.scale_add(share, a), x);
    }

    /// The place of an edge of the top that is nearest to a segment from `-half` to `half`; see [`nearest_shares`].
    #[inline(always)]
    fn offer_segment(&mut self, [a, edge]: [Vec3<F>; 2], half: Vec3<F>, hh: F, inverse: F) {
        let (s, t) = nearest_shares(half, hh, inverse, a, edge);
        self.offer(edge.scale_add(t, a), half * s);
    }

    /// The place of the side below an edge of the top that is nearest to a point; `inverse` is 1 over the squared length of the
    /// edge, seen from above.
    #[inline(always)]
    fn offer_side(&mut self, [a, edge]: [Vec3<F>; 2], inverse: F, x: Vec3<F>, bottom: F) {
        // nearest as seen from above, then at the point's height between bottom and edge
        let way = x - a;
        let along = edge[0].fma(way[0], edge[1] * way[1]);
        let share = (along * inverse).max(F::c(0.0)).min(F::c(1.0));
        let Vec3([u, v, height]) = edge.scale_add(share, a);
        self.offer(Vec3([u, v, x[2].max(bottom).min(height)]), x);
    }

    /// The nearest place, of a prism whose top has this normal.
    #[inline(always)]
    fn nearest(&self, up: Vec3<F>) -> Nearest<F> {
        // the way at unit length; only one to a place on the top may have no length
        let distance = self.square.sqrt();
        let unit = F::c(1.0).div(distance.max(F::c(TINY)));
        Nearest {
            place: self.place,
            normal: select(self.on_top, up, self.way * unit),
            distance,
        }
    }
}

impl<F: Num> Nearest<F> {
    /// The nearer of two.
    #[inline(always)]
    fn or(self, other: Nearest<F>) -> Nearest<F> {
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
    pub fn new(
        top: [Vec3<F>; 3],
        bottom: F,
        half: Half<F::Mask>,
        lattice: &Lattice<F>,
    ) -> Prism<F> {
        let [p, q, k] = [top[0][2], top[1][2], top[2][2]];
        let [x, y] = lattice.inverse;
        // how much the top falls along x and y
        let (u, v) = (half.pick(k - q, p - k) * x, half.pick(p - k, k - q) * y);
        // the top's normal is (u, v, 1), scaled to unit length
        let unit = F::c(1.0).div(u.fma(u, v.fma(v, F::c(1.0))).sqrt());
        let side = half.pick(F::c(1.0), F::c(-1.0));
        // QK runs along x and KP along y in the upper left prism, the other way round in the lower right one
        let (x, y) = (x * x, y * y);
        Prism {
            top,
            bottom,
            side,
            across: [lattice.across[0] * side, lattice.across[1] * side],
            up: Vec3([u * unit, v * unit, unit]),
            inverse: [lattice.diagonal, half.pick(x, y), half.pick(y, x)],
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
        // P is on the top and the diagonal, K on the top and both other sides
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
        // outside: the nearest place of faces and edges. Inside: the way out
        let (beyond, mut search) = (self.beyond(x), Search::new());
        self.offer_faces(x, beyond, &mut search);
        let [pq, qk, kp] = self.top_edges();
        search.offer_edge(pq, x);
        search.offer_edge(qk, x);
        search.offer_edge(kp, x);
        search.nearest(self.up).or(self.way_out(x, beyond))
    }

    /// The place nearest to a segment from `-half` to `half` that does not pass through the prism. Of an end inside, its way out.
    #[inline(always)]
    pub fn nearest_to_segment(&self, half: Vec3<F>) -> Nearest<F> {
        let mut search = Search::new();
        // edges of the top and the vertical ones below its corners, against the whole segment
        let square = half.dot(half).max(F::c(TINY));
        let inverse = F::c(1.0).div(square);
        let [pq, qk, kp] = self.top_edges();
        search.offer_segment(pq, half, square, inverse);
        search.offer_segment(qk, half, square, inverse);
        search.offer_segment(kp, half, square, inverse);
        self.offer_edges_below(half, square, inverse, &mut search);
        // faces against either end; an end inside has its way out
        let (from, to) = (self.beyond(half), self.beyond(-half));
        self.offer_faces(half, from, &mut search);
        self.offer_faces(-half, to, &mut search);
        let near = search.nearest(self.up);
        near.or(self.way_out(half, from))
            .or(self.way_out(-half, to))
    }

    /// The vertical edges below the corners of the top, for a segment with this squared half length, and 1 over it.
    #[inline(always)]
    fn offer_edges_below(&self, half: Vec3<F>, square: F, inverse: F, search: &mut Search<F>) {
        let one = F::c(1.0);
        // squared length of half the segment as seen from above
        let flat = half[0].fma(half[0], half[1] * half[1]);
        // of a vertical segment any place will do
        let unit = one.div(flat.max(square * F::c(1e-12)));
        for i in 0..3 {
            let Vec3([x, y, z]) = self.top[i];
            // share nearest to the vertical line, its height clamped to the edge, then the share for that place
            let along = half[0].fma(x, half[1] * y);
            let s = (along * unit).max(-one).min(one);
            let height = (half[2] * s).max(self.bottom).min(z);
            let s = half[2].fma(height, along) * inverse;
            search.offer(Vec3([x, y, height]), half * s.max(-one).min(one));
        }
    }

    /// The top, the sides with their edges, and the bottom, for a point this far beyond each face.
    #[inline(always)]
    fn offer_faces(&self, x: Vec3<F>, beyond: [F; 5], search: &mut Search<F>) {
        let c = F::c;
        let zero = c(0.0);
        // the point's foot on the plane of the top counts if it is beyond no side and the point is not below
        let above = self.up.scale_add(-beyond[0], x);
        let foot = self.beyond(above);
        let square = beyond[0] * beyond[0];
        let on_top = !zero.lt(foot[1].max(foot[2]).max(foot[3])) & !beyond[0].lt(zero);
        // not by `offer`: a point on the top has no way to it, but the top's normal
        let on_top = on_top & square.lt(search.square);
        search.place = select(on_top, above, search.place);
        search.square = F::select(on_top, square, search.square);
        search.on_top = search.on_top | on_top;
        // the side below each edge, at the point's height
        let ([pq, qk, kp], [u, v, w]) = (self.top_edges(), self.inverse);
        search.offer_side(pq, u, x, self.bottom);
        search.offer_side(qk, v, x, self.bottom);
        search.offer_side(kp, w, x, self.bottom);
        // a point below the bottom is nearest to it straight above. Elsewhere the place is too far to be nearer
        let below = !zero.lt(beyond[1].max(beyond[2]).max(beyond[3])) & zero.lt(beyond[4]);
        let place = Vec3([x[0], x[1], F::select(below, self.bottom, c(1e16))]);
        search.offer(place, x);
    }

    /// The way out through the nearest face, for a point inside; far away for one outside.
    #[inline(always)]
    fn way_out(&self, x: Vec3<F>, beyond: [F; 5]) -> Nearest<F> {
        // of a point inside all distances are negative: the largest is the nearest face
        let mut normal = self.up;
        let mut distance = beyond[0];
        for (m, beyond) in self.normals().into_iter().zip(beyond).skip(1) {
            normal = select(distance.lt(beyond), m, normal);
            distance = distance.max(beyond);
        }
        Nearest {
            place: normal.scale_add(-distance, x),
            normal,
            distance: F::select(F::c(0.0).lt(distance), F::c(1e18), distance),
        }
    }

    /// Edges of the top: one end, and the way to the other.
    #[inline(always)]
    pub fn top_edges(&self) -> [[Vec3<F>; 2]; 3] {
        let [p, q, k] = self.top;
        [[p, q - p], [q, k - q], [k, p - k]]
    }

    /// Its least and greatest reach along a direction.
    #[inline(always)]
    pub fn span(&self, d: Vec3<F>) -> [F; 2] {
        // each corner of the top, and that of the bottom below it
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

    /// The corner of its top that is least along a level direction.
    #[inline(always)]
    pub fn nearest_corner(&self, d: Vec3<F>) -> Vec3<F> {
        // of equally near corners the first stays
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
/// and 0 to 1. `hh` is half · half, and `inverse` 1 over it.
#[inline(always)]
fn nearest_shares<F: Num>(half: Vec3<F>, hh: F, inverse: F, a: Vec3<F>, edge: Vec3<F>) -> (F, F) {
    let c = F::c;
    let (zero, one) = (c(0.0), c(1.0));
    // minimum of |half s - a - edge t|² over s, then t, then s again for a t that was clamped
    let (he, ee) = (half.dot(edge), edge.dot(edge).max(c(TINY)));
    let (ha, ea) = (half.dot(a), edge.dot(a));
    let square = he.fnma(he, hh * ee);
    // of parallel ones any place will do
    let s = ee.fma(ha, -(he * ea)).div(square.max(hh * ee * c(1e-12)));
    let s = s.max(-one).min(one);
    let t = he.fma(s, -ea).div(ee).max(zero).min(one);
    let s = (he.fma(t, ha) * inverse).max(-one).min(one);
    (s, t)
}

impl<C: Cx> Support<C> for Prism<C::F> {
    #[inline(always)]
    fn farthest(&self, _: &mut C, d: Vec3<C::F>) -> Vec3<C::F> {
        // farthest below or above: corners of the bottom are straight below those of the top
        let is_down = d[2].lt(C::F::c(0.0));
        let corner = |a: Vec3<C::F>| Vec3([a[0], a[1], C::F::select(is_down, self.bottom, a[2])]);
        let [p, q, k] = self.top;
        let (p, q, k) = (corner(p), corner(q), corner(k));
        // of equally far corners the first stays
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
