//! Which four points of a flat contact span most of it.

use crate::lane::Num;
use crate::math::vec3::Vec3;

/// A straight line in the plane, and what is beyond it: a x + b y > d.
#[derive(Clone, Copy)]
pub(super) struct Line<F> {
    a: F,
    b: F,
    d: F,
}

impl<F: Num> Line<F> {
    /// Through two points, what is to the right beyond; all zero where they are one.
    #[inline(always)]
    fn through(p: Vec3<F>, q: Vec3<F>) -> Line<F> {
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let unit = F::c(1.0).div(dx.fma(dx, dy * dy).max(F::c(1e-24)).sqrt());
        let (a, b) = (dy * unit, -(dx * unit));
        Line {
            a,
            b,
            d: a.fma(p[0], b * p[1]),
        }
    }

    #[inline(always)]
    fn turned(self, sign: F) -> Line<F> {
        Line {
            a: self.a * sign,
            b: self.b * sign,
            d: self.d * sign,
        }
    }

    #[inline(always)]
    fn beyond(&self, x: F, y: F) -> F {
        self.a.fma(x, self.b.fma(y, -self.d))
    }
}

/// How much a point would add to those chosen so far: the second by its distance from the first, the third by that from
/// the line of the two, the fourth by how far outside the triangle it is. Numbers 0 and 1 of a point are its place.
pub(super) enum Spread<F> {
    /// One point is chosen.
    Point(Vec3<F>),
    /// Two are.
    Segment(Line<F>),
    /// Three are.
    Triangle([Line<F>; 3]),
}

impl<F: Num> Spread<F> {
    /// With `stage` + 1 of the points chosen.
    #[inline(always)]
    pub fn of(stage: usize, chosen: [Vec3<F>; 3]) -> Spread<F> {
        let [p, q, r] = chosen;
        match stage {
            0 => Spread::Point(p),
            1 => Spread::Segment(Line::through(p, q)),
            _ => {
                let base = Line::through(p, q);
                let inside = base.beyond(r[0], r[1]);
                let sign = F::select(F::c(0.0).lt(inside), F::c(-1.0), F::c(1.0));
                Spread::Triangle([
                    base.turned(sign),
                    Line::through(q, r).turned(sign),
                    Line::through(r, p).turned(sign),
                ])
            }
        }
    }

    /// The score that a point must exceed to be at least `least` away [m].
    #[inline(always)]
    pub fn threshold(&self, least: F) -> F {
        match self {
            Spread::Point(_) => least * least,
            _ => least,
        }
    }

    /// The score of a point.
    #[inline(always)]
    pub fn score(&self, x: F, y: F) -> F {
        match self {
            Spread::Point(p) => {
                let (dx, dy) = (x - p[0], y - p[1]);
                dx.fma(dx, dy * dy)
            }
            Spread::Segment(line) => line.beyond(x, y).abs(),
            Spread::Triangle(sides) => {
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
