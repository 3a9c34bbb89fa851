//! Separating axes of a prism of a height field and another shape, in the axes of that shape, where its reach is a closed form and
//! an edge's normal to one of its own axes has two components.

use super::hull_axes::{Reach, SeparatingAxis};
use super::prism::Prism;
use crate::lane::Num;
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::select::{column_at, transpose};

/// Squared sine below which an edge lies along an axis of the other shape: their common normal is that of a face.
const ALONG: f64 = 1e-6;

/// How far the other shape reaches along the normals of a prism's sides, which are those of all prisms.
pub struct FieldReach<F> {
    /// Along x, y and z of the field [m].
    pub half: Vec3<F>,
    /// Across the diagonals of cells [m].
    pub across: F,
}

/// The best separating axis of a prism and another shape, and the features it belongs to.
pub(in crate::step::collide) struct PrismAxis<F> {
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

/// A prism in the axes of another shape, from the centre of that shape.
struct OwnPrism<F> {
    /// Corners of the top, and those below them.
    top: [Vec3<F>; 3],
    bottom: [Vec3<F>; 3],
    /// Normal of the top.
    up: Vec3<F>,
    /// Axes of the field.
    field: [Vec3<F>; 3],
}

/// The best axis so far.
struct Search<F> {
    normal: Vec3<F>,
    distance: F,
    gap: F,
    /// 0: the prism's top; 1: its sides and bottom; 2: the other's faces; from 3 on: edges, four for each axis of the other.
    code: F,
}

/// What an axis must exceed to be taken.
#[derive(Clone, Copy)]
struct Limits<F> {
    tolerance: F,
    /// Least cosine of a normal to that of the top; any if negative.
    facing: f64,
}

impl<F: Num> Search<F> {
    /// Takes the axis n or -n if it is better by the tolerance and faces the top enough. The prism reaches from `low` to `high`
    /// along n, the other shape half as far as said to either side; `rise` is the cosine of n to the normal of the top.
    #[inline(always)]
    fn offer(
        &mut self,
        n: Vec3<F>,
        [low, high]: [F; 2],
        half: F,
        rise: F,
        limits: Limits<F>,
        code: f64,
    ) {
        // distances along n and along -n; the larger is a bound in any case
        let (along, against) = (low - half, -high - half);
        self.gap = self.gap.max(along).max(against);
        // n is turned against the top's normal, or where any will do to the larger distance
        let any = limits.facing < 0.0;
        let turned = match any {
            true => along.lt(against),
            false => F::c(0.0).lt(rise),
        };
        let distance = F::select(turned, against, along);
        // better by the tolerance, and within the angle to the top's normal
        let mut is = (self.distance + limits.tolerance).lt(distance);
        if !any {
            is = is & F::c(limits.facing).lt(rise.abs());
        }
        self.normal = select(is, select(turned, -n, n), self.normal);
        self.distance = F::select(is, distance, self.distance);
        self.code = F::select(is, F::c(code), self.code);
    }

    /// As [`Search::offer`] for the common normal of two edges.
    #[inline(always)]
    fn offer_common<R: Reach<F>>(
        &mut self,
        common: &Common<F>,
        up: Vec3<F>,
        other: &R,
        limits: Limits<F>,
        code: f64,
    ) {
        // of parallel ones the normal is that of a face
        let far = F::c(1e18);
        let low = F::select(common.parallel, -far, common.span[0]);
        let high = F::select(common.parallel, far, common.span[1]);
        // an infinite span makes both distances negative, so it is never taken
        let (n, half) = (common.normal, other.reach(common.normal));
        self.offer(n, [low, high], half, n.dot(up), limits, code);
    }

    /// As [`Search::offer`] for the outward normal of a face of the prism that is this far from the other shape.
    #[inline(always)]
    fn offer_face(&mut self, n: Vec3<F>, distance: F, rise: F, limits: Limits<F>) {
        // n is outward of the prism, so the axis from the other shape is -n
        self.gap = self.gap.max(distance);
        let is = (self.distance + limits.tolerance).lt(distance) & F::c(limits.facing).lt(rise);
        self.normal = select(is, -n, self.normal);
        self.distance = F::select(is, distance, self.distance);
        self.code = F::select(is, F::c(1.0), self.code);
    }
}

impl<F: Num> OwnPrism<F> {
    #[inline(always)]
    fn new(prism: &Prism<F>, axes: &Mat3<F>) -> OwnPrism<F> {
        // columns of axesᵀ: the field's axes as seen in the other's
        let Mat3(field) = transpose(axes);
        let (mut top, mut bottom) = (prism.top, prism.top);
        for i in 0..3 {
            // corners of the bottom are straight below those of the top
            let height = prism.bottom - prism.top[i][2];
            top[i] = axes.transpose_mul(prism.top[i]);
            bottom[i] = field[2].scale_add(height, top[i]);
        }
        OwnPrism {
            top,
            bottom,
            up: axes.transpose_mul(prism.up),
            field,
        }
    }

    /// Its least and greatest reach along one of the other's axes.
    #[inline(always)]
    fn span(&self, j: usize) -> [F; 2] {
        let [a, b, c] = self.top;
        let [p, q, r] = self.bottom;
        // over all six corners
        let low = a[j].min(b[j]).min(c[j]).min(p[j].min(q[j]).min(r[j]));
        let high = a[j].max(b[j]).max(c[j]).max(p[j].max(q[j]).max(r[j]));
        [low, high]
    }

    /// Edges of its top, then the way down, each with its squared length.
    #[inline(always)]
    fn edges(&self) -> [(Vec3<F>, F); 4] {
        let [p, q, k] = self.top;
        let (pq, qk, kp) = (q - p, k - q, p - k);
        [
            (pq, pq.dot(pq)),
            (qk, qk.dot(qk)),
            (kp, kp.dot(kp)),
            (-self.field[2], F::c(1.0)),
        ]
    }

    /// The common normal of edge `I` and axis `J` of the other shape. A loop over both is not unrolled.
    #[inline(always)]
    fn across<const I: usize, const J: usize>(&self, (edge, length): (Vec3<F>, F)) -> Common<F> {
        // e × axis J has the components (e_l, -e_k) along k and l alone
        let (k, l) = ((J + 1) % 3, (J + 2) % 3);
        let (x, y) = (edge[l], -edge[k]);
        // |e × axis| is |e| sin; below a small part of |e| the edges count as parallel
        let square = x.fma(x, y * y);
        let least = length * F::c(ALONG);
        let unit = F::c(1.0).div(square.max(least).sqrt());
        // both ends of an edge of the top are as far, and so is what lies below a corner across an upright edge
        let (a, b) = (self.top[I % 3], self.top[(I + 2) % 3]);
        let (a, b) = (x.fma(a[k], y * a[l]), x.fma(b[k], y * b[l]));
        let (mut low, mut high) = (a.min(b), a.max(b));
        // an edge of the top: the bottom's corners too. A vertical one: the third corner of the top
        if I < 3 {
            let [p, q, r] = self.bottom;
            let (p, q) = (x.fma(p[k], y * p[l]), x.fma(q[k], y * q[l]));
            let r = x.fma(r[k], y * r[l]);
            low = low.min(p).min(q.min(r));
            high = high.max(p).max(q.max(r));
        } else {
            let c = self.top[1];
            let c = x.fma(c[k], y * c[l]);
            (low, high) = (low.min(c), high.max(c));
        }
        // spans scale to the unit normal
        let mut normal = [F::c(0.0); 3];
        normal[k] = x * unit;
        normal[l] = y * unit;
        Common {
            normal: Vec3(normal),
            span: [low * unit, high * unit],
            parallel: square.lt(least),
        }
    }

    /// The larger of `gap` and the distance along the common normals of all edges and axis `J` of the other shape.
    #[inline(always)]
    fn gap_across<const J: usize, R: Reach<F>>(&self, other: &R, radius: F, gap: F) -> F {
        let [pq, qk, kp, down] = self.edges();
        let gap = gap.max(self.across::<0, J>(pq).gap(other, radius));
        let gap = gap.max(self.across::<1, J>(qk).gap(other, radius));
        let gap = gap.max(self.across::<2, J>(kp).gap(other, radius));
        gap.max(self.across::<3, J>(down).gap(other, radius))
    }

    /// Offers the common normals of all edges and axis `J` of the other shape.
    #[inline(always)]
    fn offer_across<const J: usize, R: Reach<F>>(
        &self,
        other: &R,
        limits: Limits<F>,
        best: &mut Search<F>,
    ) {
        // the edges below its corners are parallel: one axis for all three
        let [pq, qk, kp, down] = self.edges();
        // code 3 + 4 J + I names the pair of edges
        let code = (3 + 4 * J) as f64;
        best.offer_common(&self.across::<0, J>(pq), self.up, other, limits, code);
        best.offer_common(&self.across::<1, J>(qk), self.up, other, limits, code + 1.0);
        best.offer_common(&self.across::<2, J>(kp), self.up, other, limits, code + 2.0);
        best.offer_common(
            &self.across::<3, J>(down),
            self.up,
            other,
            limits,
            code + 3.0,
        );
    }
}

/// The common unit normal of two edges, the least and greatest reach of the prism along it, and whether the edges are parallel:
/// then it is none.
struct Common<F: Num> {
    normal: Vec3<F>,
    span: [F; 2],
    parallel: F::Mask,
}

impl<F: Num> Common<F> {
    /// The distance of the prism and the other shape.
    #[inline(always)]
    fn gap<R: Reach<F>>(&self, other: &R, radius: F) -> F {
        // distance along n or -n; parallel edges have none
        let half = other.reach(self.normal) + radius;
        let gap = (self.span[0] - half).max(-self.span[1] - half);
        F::select(self.parallel, F::c(-1e18), gap)
    }
}

impl<F: Num> Prism<F> {
    /// A lower bound of the distance to another shape, which has the given axes and its centre at the origin: along the normals
    /// of all faces and, if asked, of all pairs of edges.
    #[inline(always)]
    pub fn gap<R: Reach<F>>(
        &self,
        axes: &Mat3<F>,
        other: &R,
        radius: F,
        field: &FieldReach<F>,
        with_edges: bool,
    ) -> F {
        // how far the origin, the other's centre, lies beyond each face
        let [top, x, y, across, bottom] = self.beyond(Vec3::zero());
        let local = OwnPrism::new(self, axes);
        // normals of sides and bottom are the same for all prisms, so their reaches are known
        let mut gap = (x - field.half[0]).max(y - field.half[1]);
        gap = gap
            .max(across - field.across)
            .max(bottom - field.half[2])
            .max(top - other.reach(local.up) - radius);
        // faces of the other shape: the prism's span against half its width to either side
        for &j in R::FACES {
            let mut unit = [F::c(0.0); 3];
            unit[j] = F::c(1.0);
            let (half, [low, high]) = (other.reach(Vec3(unit)) + radius, local.span(j));
            gap = gap.max(low - half).max(-high - half);
        }
        // pairs of edges; which axes have edges is known at compile time
        if with_edges {
            if R::EDGES.contains(&0) {
                gap = local.gap_across::<0, R>(other, radius, gap);
            }
            if R::EDGES.contains(&1) {
                gap = local.gap_across::<1, R>(other, radius, gap);
            }
            if R::EDGES.contains(&2) {
                gap = local.gap_across::<2, R>(other, radius, gap);
            }
        }
        gap
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
        let c = F::c;
        let local = OwnPrism::new(self, axes);
        let [top, x, y, across, bottom] = self.beyond(Vec3::zero());
        // the top's normal first: it faces the top, so it may always be the way out
        let distance = top - other.reach(local.up);
        let mut best = Search {
            normal: -local.up,
            distance,
            gap: distance,
            code: c(0.0),
        };
        let limits = Limits { tolerance, facing };
        // sides and bottom: outward normals in the other's axes
        let [u, v, w] = local.field;
        let (side, [a, b]) = (self.side, self.across);
        let m = u * -side;
        best.offer_face(m, x - other.reach(m), m.dot(local.up), limits);
        let m = v * side;
        best.offer_face(m, y - other.reach(m), m.dot(local.up), limits);
        let m = u.scale_add(a, v * b);
        best.offer_face(m, across - other.reach(m), m.dot(local.up), limits);
        best.offer_face(-w, bottom - other.reach(w), -w.dot(local.up), limits);
        // faces of the other; the cosine to the top's normal is a component of `up`
        for &j in R::FACES {
            let mut unit = [c(0.0); 3];
            unit[j] = c(1.0);
            let (unit, rise) = (Vec3(unit), local.up[j]);
            best.offer(unit, local.span(j), other.reach(unit), rise, limits, 2.0);
        }
        // pairs of edges, by axis of the other
        if R::EDGES.contains(&0) {
            local.offer_across::<0, R>(other, limits, &mut best);
        }
        if R::EDGES.contains(&1) {
            local.offer_across::<1, R>(other, limits, &mut best);
        }
        if R::EDGES.contains(&2) {
            local.offer_across::<2, R>(other, limits, &mut best);
        }
        self.features(axes, &best)
    }

    /// The axis that was found, in the field's axes, with its features.
    #[inline(always)]
    fn features(&self, axes: &Mat3<F>, best: &Search<F>) -> PrismAxis<F> {
        let c = F::c;
        let code = best.code;
        // the normal of the top as it is, without the error of two rotations
        let normal = select(code.lt(c(0.5)), -self.up, *axes * best.normal);
        // from code = 3 + 4 j + i: axis j of the other, edge i of the prism
        let j = F::select(code.lt(c(6.5)), c(0.0), c(1.0));
        let j = F::select(code.lt(c(10.5)), j, c(2.0));
        let i = code - j.fma(c(4.0), c(3.0));
        // a point and the direction of edge i; of a vertical one, the corner nearest along the normal
        let [p, q, k] = self.top;
        let [[_, pq], [_, qk], [_, kp]] = self.top_edges();
        let (first, second, third) = (i.lt(c(0.5)), i.lt(c(1.5)), i.lt(c(2.5)));
        let corner = select(third, k, self.nearest_corner(normal));
        let way = select(third, kp, Vec3([c(0.0), c(0.0), c(-1.0)]));
        let corner = select(first, p, select(second, q, corner));
        let way = select(first, pq, select(second, qk, way));
        // codes 0 and 1 are faces of the prism, 2 of the other, and edges from 3 on
        let of_edges = F::select(c(2.5).lt(code), c(2.0), c(1.0));
        PrismAxis {
            axis: SeparatingAxis {
                normal,
                distance: best.distance,
            },
            gap: best.gap,
            kind: F::select(code.lt(c(1.5)), c(0.0), of_edges),
            edge: [corner, way * c(1.0).div(way.dot(way).sqrt())],
            other: column_at(j, *axes),
        }
    }
}
