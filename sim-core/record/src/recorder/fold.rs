//! Algebra on recorded values: folds constants and moves negations outwards.
//!
//! Every rule keeps the result bit for bit where values are finite, up to the sign of a zero.
//! Operands that commute are put in one order, constants last, so that equal values are shared and
//! the two recordings of a loop's body agree.

use crate::ir::tree::{Binary, Op, Operand, Unary};
use crate::recorder::state::State;
use Operand::Truth;
use sim_physics::lane::Num;

fn number(x: f32) -> Operand {
    Operand::number(x)
}

fn both(a: Operand, b: Operand) -> Option<(f32, f32)> {
    Some((a.constant()?, b.constant()?))
}

/// Older values first, constants last.
fn ordered(a: Operand, b: Operand) -> (Operand, Operand) {
    match (a, b) {
        (Operand::Value(x), Operand::Value(y)) if x > y => (b, a),
        (Operand::Constant(_) | Truth(_), Operand::Value(_)) => (b, a),
        _ => (a, b),
    }
}

/// `1 / x` where multiplying by it bounds as dividing by `x` does: powers of two.
fn exact_inverse(x: f32) -> Option<f32> {
    let inverse = 1.0 / x;
    let is_power_of_two = x.is_normal() && x.to_bits() << 9 == 0;
    (is_power_of_two && inverse.is_normal()).then_some(inverse)
}

/// The product, where it needs no rounding.
fn exact_product(x: f32, y: f32) -> Option<f32> {
    let exact = f64::from(x) * f64::from(y); // 48 bits fit a double
    let rounded = exact as f32;
    (f64::from(rounded) == exact).then_some(rounded)
}

impl State {
    fn op(&self, a: Operand) -> Option<Op> {
        match a {
            Operand::Value(number) => Some(self.values[number as usize].op),
            _ => None,
        }
    }

    /// `x` where `a` is `-x`.
    fn negated(&self, a: Operand) -> Option<Operand> {
        match self.op(a) {
            Some(Op::Unary(Unary::Neg, x)) => Some(x),
            _ => None,
        }
    }

    /// Takes a minus away; true if there was one.
    fn unsigned(&self, a: Operand) -> (Operand, bool) {
        match self.negated(a) {
            Some(x) => (x, true),
            None => (a, false),
        }
    }

    fn signed(&mut self, a: Operand, negative: bool) -> Operand {
        if negative { self.neg(a) } else { a }
    }

    pub(super) fn neg(&mut self, a: Operand) -> Operand {
        match (a.constant(), self.negated(a)) {
            (Some(x), _) => number(-x),
            (None, Some(x)) => x,
            (None, None) => self.value(Op::Unary(Unary::Neg, a)),
        }
    }

    pub(super) fn add(&mut self, a: Operand, b: Operand) -> Operand {
        let (a, b) = ordered(a, b);
        if let Some((x, y)) = both(a, b) {
            return number(x + y);
        }
        if b.constant() == Some(0.0) {
            return a;
        }
        match (self.negated(a), self.negated(b)) {
            (Some(x), Some(y)) => {
                let sum = self.add(x, y);
                self.neg(sum)
            }
            (None, Some(y)) => self.sub(a, y),
            (Some(x), None) => self.sub(b, x),
            (None, None) => self.value(Op::Binary(Binary::Add, a, b)),
        }
    }

    pub(super) fn sub(&mut self, a: Operand, b: Operand) -> Operand {
        if let Some(y) = b.constant() {
            return self.add(a, number(-y));
        }
        if a == b {
            return number(0.0);
        }
        if a.constant() == Some(0.0) {
            return self.neg(b);
        }
        match (self.negated(a), self.negated(b)) {
            (Some(x), Some(y)) => self.sub(y, x),
            (None, Some(y)) => self.add(a, y),
            (Some(x), None) => {
                let sum = self.add(x, b);
                self.neg(sum)
            }
            (None, None) => self.value(Op::Binary(Binary::Sub, a, b)),
        }
    }

    pub(super) fn mul(&mut self, a: Operand, b: Operand) -> Operand {
        let (a, b) = ordered(a, b);
        match (a.constant(), b.constant()) {
            (Some(x), Some(y)) => return number(x * y),
            (None, Some(0.0)) => return number(0.0),
            (None, Some(1.0)) => return a,
            (None, Some(y)) if y < 0.0 => {
                let product = self.mul(a, number(-y));
                return self.neg(product);
            }
            _ => {}
        }
        let ((x, minus_x), (y, minus_y)) = (self.unsigned(a), self.unsigned(b));
        let (x, y) = ordered(x, y);
        let product = self.value(Op::Binary(Binary::Mul, x, y));
        self.signed(product, minus_x != minus_y)
    }

    /// `a * b + c`, or `c - a * b` where `minus` holds.
    pub(super) fn fma(&mut self, a: Operand, b: Operand, c: Operand, minus: bool) -> Operand {
        let ((a, minus_a), (b, minus_b)) = (self.unsigned(a), self.unsigned(b));
        let minus = minus ^ minus_a ^ minus_b;
        let (a, b) = ordered(a, b);
        if c.constant() == Some(0.0) {
            let product = self.mul(a, b);
            return self.signed(product, minus);
        }
        if let Some((x, y)) = both(a, b) {
            let x = if minus { -x } else { x };
            if let Some(z) = c.constant() {
                return number(x.mul_add(y, z));
            }
            if let Some(product) = exact_product(x, y) {
                return self.add(c, number(product));
            }
            return self.value(Op::Fma(number(x), b, c));
        }
        if let Some(y) = b.constant() {
            let y = if minus { -y } else { y };
            return match y {
                0.0 => c,
                1.0 => self.add(a, c),
                -1.0 => self.sub(c, a),
                _ => self.value(Op::Fma(a, number(y), c)),
            };
        }
        match self.negated(c) {
            Some(z) if minus => {
                let sum = self.value(Op::Fma(a, b, z));
                self.neg(sum)
            }
            _ => {
                let a = self.signed(a, minus);
                self.value(Op::Fma(a, b, c))
            }
        }
    }

    pub(super) fn div(&mut self, a: Operand, b: Operand) -> Operand {
        if let Some((x, y)) = both(a, b) {
            return number(x / y);
        }
        if let Some(inverse) = b.constant().and_then(exact_inverse) {
            return self.mul(a, number(inverse));
        }
        let ((x, minus_x), (y, minus_y)) = (self.unsigned(a), self.unsigned(b));
        let quotient = self.value(Op::Binary(Binary::Div, x, y));
        self.signed(quotient, minus_x != minus_y)
    }

    pub(super) fn sqrt(&mut self, a: Operand) -> Operand {
        match a.constant() {
            Some(x) => number(x.sqrt()),
            None => self.value(Op::Unary(Unary::Sqrt, a)),
        }
    }

    /// Operands keep their order: if one is NaN, the second counts.
    pub(super) fn min(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.constant(), b.constant()) {
            (Some(x), Some(y)) => number(Num::min(x, y)),
            (None, Some(f32::INFINITY)) => a,
            _ if a == b => a,
            _ => self.value(Op::Binary(Binary::Min, a, b)),
        }
    }

    /// Operands keep their order: if one is NaN, the second counts.
    pub(super) fn max(&mut self, a: Operand, b: Operand) -> Operand {
        match (a.constant(), b.constant()) {
            (Some(x), Some(y)) => number(Num::max(x, y)),
            (None, Some(f32::NEG_INFINITY)) => a,
            _ if a == b => a,
            _ => self.value(Op::Binary(Binary::Max, a, b)),
        }
    }

    pub(super) fn abs(&mut self, a: Operand) -> Operand {
        if let Some(x) = a.constant() {
            return number(x.abs());
        }
        let (a, _) = self.unsigned(a);
        match self.op(a) {
            Some(Op::Unary(Unary::Abs | Unary::Sqrt, _)) => a,
            _ => self.value(Op::Unary(Unary::Abs, a)),
        }
    }

    pub(super) fn round(&mut self, a: Operand) -> Operand {
        if let Some(x) = a.constant() {
            return number(x.round_ties_even());
        }
        let (a, minus) = self.unsigned(a);
        let rounded = match self.op(a) {
            Some(Op::Unary(Unary::Round, _)) => a,
            _ => self.value(Op::Unary(Unary::Round, a)),
        };
        self.signed(rounded, minus)
    }

    pub(super) fn lt(&mut self, a: Operand, b: Operand) -> Operand {
        match (both(a, b), self.negated(a), self.negated(b)) {
            (Some((x, y)), ..) => Truth(x < y),
            _ if a == b => Truth(false),
            (None, Some(x), Some(y)) => self.value(Op::Binary(Binary::Lt, y, x)),
            _ => self.value(Op::Binary(Binary::Lt, a, b)),
        }
    }

    pub(super) fn select(&mut self, mask: Operand, a: Operand, b: Operand) -> Operand {
        match (mask, self.op(mask)) {
            (Truth(mask), _) => {
                if mask {
                    a
                } else {
                    b
                }
            }
            _ if a == b => a,
            (_, Some(Op::Unary(Unary::Not, mask))) => self.value(Op::Select(mask, b, a)),
            _ => self.value(Op::Select(mask, a, b)),
        }
    }

    pub(super) fn and(&mut self, a: Operand, b: Operand) -> Operand {
        match ordered(a, b) {
            (x, Truth(true)) => x,
            (_, Truth(false)) => Truth(false),
            (x, y) if x == y => x,
            (x, y) => self.value(Op::Binary(Binary::And, x, y)),
        }
    }

    pub(super) fn or(&mut self, a: Operand, b: Operand) -> Operand {
        match ordered(a, b) {
            (x, Truth(false)) => x,
            (_, Truth(true)) => Truth(true),
            (x, y) if x == y => x,
            (x, y) => self.value(Op::Binary(Binary::Or, x, y)),
        }
    }

    pub(super) fn not(&mut self, a: Operand) -> Operand {
        match (a, self.op(a)) {
            (Truth(x), _) => Truth(!x),
            (_, Some(Op::Unary(Unary::Not, x))) => x,
            _ => self.value(Op::Unary(Unary::Not, a)),
        }
    }
}
