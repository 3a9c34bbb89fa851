//! GJK: the point of the Minkowski difference of two separate shapes that is nearest to the origin (Gilbert, Johnson and
//! Keerthi 1988; van den Bergen 2003, section 4.3).
//!
//! Each iteration adds the support point against the nearest point so far, and takes the nearest point of the tetrahedron of
//! it and the three corners kept. That point lies on a corner, edge or face at the new corner, so one corner is dropped.

use super::support::{Support, minkowski_support};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::variables::{get3, set3, var3};
use crate::{break_if, times};

/// Relative difference of upper and lower bound at which GJK ends. The error of a direction is its square root.
const fn tolerance<R: Real>() -> f64 {
    if R::DOUBLE { 1e-13 } else { 1e-6 }
}

/// Most iterations: on a curved surface each takes only a share off the error.
const fn iterations<R: Real>() -> usize {
    if R::DOUBLE { 64 } else { 24 }
}

/// The first simplex: one point.
pub(in crate::step::collide) struct Start<F> {
    /// The first axis, a unit vector.
    pub axis: Vec3<F>,
    /// How B is moved before all [m].
    pub away: Vec3<F>,
    /// The point of A farthest along the axis.
    pub on_a: Vec3<F>,
    /// The point of the difference that is least along the axis, B moved.
    pub w: Vec3<F>,
}

/// What GJK finds.
pub(in crate::step::collide) struct Distance<F> {
    /// The best axis, and the distance along it.
    pub normal: Vec3<F>,
    pub distance: F,
    /// The closest point of A, and the way from there to that of B.
    pub on_a: Vec3<F>,
    pub way: Vec3<F>,
}

/// Three corners of the simplex, and the nearest point.
struct Simplex<C: Cx> {
    /// Points of the difference.
    corners: [[C::V; 3]; 3],
    /// The points of A that they are made of.
    points: [[C::V; 3]; 3],
    /// Barycentric coordinates of the nearest point.
    shares: [C::V; 3],
    nearest: [C::V; 3],
}

impl<C: Cx> Simplex<C> {
    #[inline(always)]
    fn new(cx: &mut C, w: Vec3<C::F>, on_a: Vec3<C::F>) -> Self {
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        // one point, three times, with all weight on the first
        Simplex {
            corners: [var3(cx, w), var3(cx, w), var3(cx, w)],
            points: [var3(cx, on_a), var3(cx, on_a), var3(cx, on_a)],
            shares: var3(cx, Vec3([one, zero, zero])),
            nearest: var3(cx, w),
        }
    }

    /// The edges from a new corner to those of the simplex.
    #[inline(always)]
    fn edges_from(&self, cx: &mut C, w: Vec3<C::F>) -> Edges<C::F> {
        // the corners kept, and their points of A
        let o = [
            get3(cx, &self.corners[0]),
            get3(cx, &self.corners[1]),
            get3(cx, &self.corners[2]),
        ];
        let p = [
            get3(cx, &self.points[0]),
            get3(cx, &self.points[1]),
            get3(cx, &self.points[2]),
        ];
        // e_k = o_k - w
        let e = [o[0] - w, o[1] - w, o[2] - w];
        Edges {
            w,
            e,
            squares: [e[0].dot(e[0]), e[1].dot(e[1]), e[2].dot(e[2])],
            corners: o,
            points: p,
        }
    }

    /// Keeps the new corner, with the others of the edge or face that the nearest point is on.
    #[inline(always)]
    fn keep(&mut self, cx: &mut C, w: Vec3<C::F>, on_a: Vec3<C::F>, best: &Nearest<C::F>) {
        // the new corner first, then the ends of the edge or face, as the shares have them
        let [o1, o2] = best.corners;
        let [p1, p2] = best.points;
        for (place, x) in [(0, w), (1, o1), (2, o2)] {
            set3(cx, &mut self.corners[place], x);
        }
        for (place, x) in [(0, on_a), (1, p1), (2, p2)] {
            set3(cx, &mut self.points[place], x);
        }
        // nearest point = (1 - s - t) w + s o₁ + t o₂
        set3(
            cx,
            &mut self.shares,
            Vec3([C::F::c(1.0) - best.s - best.t, best.s, best.t]),
        );
        set3(cx, &mut self.nearest, best.foot);
    }

    /// The point of A that belongs to the nearest point.
    #[inline(always)]
    fn on_a(&self, cx: &C) -> Vec3<C::F> {
        // the point of A has the shares of the nearest point: each corner is a point of B less one of A
        let share = get3(cx, &self.shares);
        let (p0, p1, p2) = (
            get3(cx, &self.points[0]),
            get3(cx, &self.points[1]),
            get3(cx, &self.points[2]),
        );
        p0.scale_add(share[0], p1.scale_add(share[1], p2 * share[2]))
    }
}

/// Edges from the new corner `w` to three others.
struct Edges<F> {
    w: Vec3<F>,
    e: [Vec3<F>; 3],
    squares: [F; 3],
    /// The other corners, and their points of A.
    corners: [Vec3<F>; 3],
    points: [Vec3<F>; 3],
}

/// The nearest point so far of a tetrahedron: foot = w + s e₁ + t e₂.
struct Nearest<F> {
    square: F,
    s: F,
    t: F,
    foot: Vec3<F>,
    /// The ends of e₁ and e₂, and their points of A.
    corners: [Vec3<F>; 2],
    points: [Vec3<F>; 2],
}

impl<F: Num> Nearest<F> {
    /// Takes the corners k and the next one where the mask holds.
    #[inline(always)]
    fn take_corners(&mut self, is: F::Mask, edges: &Edges<F>, k: usize) {
        // of a face both corners have shares; of an edge the second has none (t = 0)
        let (o, p, l) = (&edges.corners, &edges.points, (k + 1) % 3);
        self.corners = [
            select(is, o[k], self.corners[0]),
            select(is, o[l], self.corners[1]),
        ];
        self.points = [
            select(is, p[k], self.points[0]),
            select(is, p[l], self.points[1]),
        ];
    }
}

impl<F: Num> Edges<F> {
    /// The point of the three edges that is nearest to the origin.
    #[inline(always)]
    fn nearest_on_edges(&self) -> Nearest<F> {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let (w, e) = (self.w, &self.e);
        // w + t e is nearest to the origin at t = -(e · w)/(e · e)
        let along = [e[0].dot(w), e[1].dot(w), e[2].dot(w)];
        // farther than any edge: the first one replaces it
        let mut best = Nearest {
            square: F::c(1e18),
            s: zero,
            t: zero,
            foot: w,
            corners: [self.corners[0], self.corners[1]],
            points: [self.points[0], self.points[1]],
        };
        for k in 0..3 {
            // clamped to the edge; an edge without length stays finite
            let t = (-along[k])
                .div(self.squares[k].max(F::c(1e-30)))
                .max(zero)
                .min(one);
            let x = e[k].scale_add(t, w);
            let square = x.dot(x);
            // of edges that are equally near the first stays
            let is = square.lt(best.square);
            best.square = F::select(is, square, best.square);
            best.foot = select(is, x, best.foot);
            best.s = F::select(is, t, best.s);
            best.take_corners(is, self, k);
        }
        best
    }

    /// Takes the point of the inside of a face, where it is nearer than `best`.
    ///
    /// By cross products: of thin triangles, which close points of a curved surface make, dot products lose too many digits.
    #[inline(always)]
    fn nearest_on_faces(&self, best: &mut Nearest<F>) {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let (w, e, ee) = (self.w, &self.e, &self.squares);
        // e × w
        let moment = [e[0].cross(w), e[1].cross(w), e[2].cross(w)];
        for k in 0..3 {
            let l = (k + 1) % 3;
            // normal of the face, n = e_k × e_l, and 1/n², guarded for faces without area
            let area = e[k].cross(e[l]);
            let square = area.dot(area);
            let inverse = one.div(square.max(F::c(1e-36)));
            // w + s e_k + t e_l ∥ n: s = (e_l × w) · n/n², t = -(e_k × w) · n/n²
            let s = moment[l].dot(area) * inverse;
            let t = -(moment[k].dot(area) * inverse);
            // squared distance of the face's plane: (n · w)²/n²
            let height = area.dot(w);
            let distance = height * height * inverse;
            // of a triangle without area only the edges count
            let wide = (ee[k] * ee[l] * F::c(1e4 * F::Real::EPSILON * F::Real::EPSILON)).lt(square);
            // all three barycentric coordinates are positive
            let inside = zero.lt(s) & zero.lt(t) & (s + t).lt(one);
            let is = wide & inside & distance.lt(best.square);
            // foot = n (n · w)/n²
            best.square = F::select(is, distance, best.square);
            best.foot = select(is, area * (height * inverse), best.foot);
            best.s = F::select(is, s, best.s);
            best.t = F::select(is, t, best.t);
            best.take_corners(is, self, k);
        }
    }
}

/// GJK for shapes that are apart once B is moved. Past the distance `limit` it goes no further.
#[inline(always)]
pub(in crate::step::collide) fn gjk_distance<C: Cx>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    start: &Start<C::F>,
    size: C::F,
    limit: C::F,
) -> Distance<C::F> {
    let c = C::F::c;
    // relative tolerance of |v|², and rounding of a length
    let tolerance = c(tolerance::<RealOf<C>>());
    let noise = size * c(RealOf::<C>::EPSILON);
    // the lower bound begins with the distance along the start axis
    let mut simplex = Simplex::new(cx, start.w, start.on_a);
    let mut normal = var3(cx, start.axis);
    let mut low = cx.var(start.axis.dot(start.w));
    times!(cx, iterations::<RealOf<C>>(), {
        // v, the nearest point of the simplex, and the support point w that is least along it
        let v = get3(cx, &simplex.nearest);
        let square = v.dot(v);
        let length = square.sqrt();
        let (on_a, w) = minkowski_support(cx, a, b, v);
        let w = w + start.away;
        // |v| is an upper bound of the distance, v · w / |v| a lower one
        let along = v.dot(w);
        let unit = c(1.0).div(length.max(c(1e-18)));
        let bound = along * unit;
        // the largest lower bound so far, and its axis: bounds need not grow from one iteration to the next
        let old = cx.get(&low);
        let better = old.lt(bound);
        let kept = get3(cx, &normal);
        cx.set(&mut low, C::F::select(better, bound, old));
        set3(cx, &mut normal, select(better, v * unit, kept));
        // done when both bounds agree, |v|² - v · w ≈ 0, or when the lower one is past the limit
        let done = (square - along).lt(tolerance.fma(square, noise * length));
        let done = done | limit.lt(bound);
        break_if!(cx, done);

        // nearest point of the tetrahedron of w and the three corners: edges, then faces that are nearer
        let edges = simplex.edges_from(cx, w);
        let mut best = edges.nearest_on_edges();
        edges.nearest_on_faces(&mut best);
        // rounding has the last word: no corner brings the simplex nearer
        let stuck = !best.square.lt(square);
        break_if!(cx, stuck);
        simplex.keep(cx, w, on_a, &best);
    });
    // the closest point of A, the best axis and its bound
    Distance {
        on_a: simplex.on_a(cx),
        normal: get3(cx, &normal),
        distance: cx.get(&low),
        way: get3(cx, &simplex.nearest),
    }
}

type RealOf<C> = <<C as Cx>::F as Num>::Real;
