//! Reduction of a flat contact to the four points that span most of it.
//!
//! Points are chosen one after the other: the deepest, the farthest from it, the farthest from the line of both, and the
//! farthest outside the triangle of the three (as in Bullet's and PhysX' contact reduction).

use crate::lane::Num;
use crate::math::vec3::Vec3;

/// A line in the plane; a point is beyond it where a x + b y > d.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct Line<F> {
    a: F,
    b: F,
    d: F,
}

impl<F: Num> Line<F> {
    /// Through two points: what is to their right is beyond. All zero where they coincide.
    #[inline(always)]
    fn through(p: Vec3<F>, q: Vec3<F>) -> Line<F> {
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        // unit normal to the right of p q: (dy, -dx)/|d|; 0 where the points coincide, since dx and dy are 0 there
        let unit = F::c(1.0).div(dx.fma(dx, dy * dy).max(F::c(1e-24)).sqrt());
        let (a, b) = (dy * unit, -(dx * unit));
        Line {
            a,
            b,
            d: a.fma(p[0], b * p[1]),
        }
    }

    /// The same line; where the sign is -1 the other side is beyond.
    #[inline(always)]
    fn facing(self, sign: F) -> Line<F> {
        Line {
            a: self.a * sign,
            b: self.b * sign,
            d: self.d * sign,
        }
    }

    /// How far beyond a point is.
    #[inline(always)]
    fn beyond(&self, x: F, y: F) -> F {
        self.a.fma(x, self.b.fma(y, -self.d))
    }
}

/// How much a point would add to those chosen so far. Components 0 and 1 of a point are its place in the plane.
pub(in crate::step::collide) enum ReductionScore<F> {
    /// One point is chosen: squared distance from it.
    Point(Vec3<F>),
    /// Two are: distance from their line.
    Segment(Line<F>),
    /// Three are: distance outside their triangle.
    Triangle([Line<F>; 3]),
}

impl<F: Num> ReductionScore<F> {
    /// With `count` + 1 of the points chosen.
    #[inline(always)]
    pub fn from_chosen(count: usize, chosen: [Vec3<F>; 3]) -> ReductionScore<F> {
        // only the first `count` + 1 of the points are read
        let [p, q, r] = chosen;
        match count {
            0 => ReductionScore::Point(p),
            1 => ReductionScore::Segment(Line::through(p, q)),
            // the sides pq, qr, rp, each with the outside of the triangle beyond it
            _ => {
                let base = Line::through(p, q);
                // the third point may lie on either side of the first two
                let inside = base.beyond(r[0], r[1]);
                let sign = F::select(F::c(0.0).lt(inside), F::c(-1.0), F::c(1.0));
                ReductionScore::Triangle([
                    base.facing(sign),
                    Line::through(q, r).facing(sign),
                    Line::through(r, p).facing(sign),
                ])
            }
        }
    }

    /// The score that a point must exceed to be at least `least` away [m].
    #[inline(always)]
    pub fn threshold(&self, least: F) -> F {
        // the score of a single point is a squared distance, so its threshold is squared too
        match self {
            ReductionScore::Point(_) => least * least,
            _ => least,
        }
    }

    /// The score of a point.
    #[inline(always)]
    pub fn at(&self, x: F, y: F) -> F {
        match self {
            ReductionScore::Point(p) => {
                let (dx, dy) = (x - p[0], y - p[1]);
                dx.fma(dx, dy * dy)
            }
            // a point may lie on either side of the line
            ReductionScore::Segment(line) => line.beyond(x, y).abs(),
            // beyond a triangle: the largest distance beyond any of its sides, negative inside
            ReductionScore::Triangle(sides) => {
                let (p, q, r) = (
                    sides[0].beyond(x, y),
                    sides[1].beyond(x, y),
                    sides[2].beyond(x, y),
                );
                p.max(q).max(r)
            }
        }
    }
}
