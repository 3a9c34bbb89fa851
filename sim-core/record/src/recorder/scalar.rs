//! Arithmetic of recorded scalars and masks.

use crate::ir::tree::Operand;
use crate::recorder::handles::{NOWHERE, Recorded, RecordedMask};
use crate::recorder::state::{State, here, with};
use sim_physics::lane::Num;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};
use std::panic::Location;

type Rule1 = fn(&mut State, Operand) -> Operand;
type Rule2 = fn(&mut State, Operand, Operand) -> Operand;

#[track_caller]
fn unary(rule: Rule1, a: Recorded) -> Recorded {
    with(Location::caller(), |s| {
        let a = s.see(a);
        let x = rule(s, a);
        s.handle(x)
    })
}

#[track_caller]
fn binary(rule: Rule2, a: Recorded, b: Recorded) -> Recorded {
    with(Location::caller(), |s| {
        let (a, b) = (s.see(a), s.see(b));
        let x = rule(s, a, b);
        s.handle(x)
    })
}

#[track_caller]
fn fused(a: Recorded, b: Recorded, c: Recorded, minus: bool) -> Recorded {
    with(Location::caller(), |s| {
        let (a, b, c) = (s.see(a), s.see(b), s.see(c));
        let x = s.fma(a, b, c, minus);
        s.handle(x)
    })
}

/// A constant belongs to the block in which it was made, so that one cannot leave it unnoticed.
fn constant(operand: Operand) -> Recorded {
    Recorded {
        operand,
        home: here(),
    }
}

impl Default for Recorded {
    fn default() -> Recorded {
        Recorded {
            operand: Operand::number(0.0),
            home: NOWHERE,
        }
    }
}

impl Add for Recorded {
    type Output = Recorded;
    #[track_caller]
    fn add(self, b: Recorded) -> Recorded {
        binary(State::add, self, b)
    }
}

impl Sub for Recorded {
    type Output = Recorded;
    #[track_caller]
    fn sub(self, b: Recorded) -> Recorded {
        binary(State::sub, self, b)
    }
}

impl Mul for Recorded {
    type Output = Recorded;
    #[track_caller]
    fn mul(self, b: Recorded) -> Recorded {
        binary(State::mul, self, b)
    }
}

impl Neg for Recorded {
    type Output = Recorded;
    #[track_caller]
    fn neg(self) -> Recorded {
        unary(State::neg, self)
    }
}

impl BitAnd for RecordedMask {
    type Output = RecordedMask;
    #[track_caller]
    fn bitand(self, b: RecordedMask) -> RecordedMask {
        RecordedMask(binary(State::and, self.0, b.0))
    }
}

impl BitOr for RecordedMask {
    type Output = RecordedMask;
    #[track_caller]
    fn bitor(self, b: RecordedMask) -> RecordedMask {
        RecordedMask(binary(State::or, self.0, b.0))
    }
}

impl Not for RecordedMask {
    type Output = RecordedMask;
    #[track_caller]
    fn not(self) -> RecordedMask {
        RecordedMask(unary(State::not, self.0))
    }
}

impl Num for Recorded {
    type Real = f32;
    type Mask = RecordedMask;

    fn k(x: f32) -> Recorded {
        constant(Operand::number(x))
    }
    #[track_caller]
    fn fma(self, b: Recorded, c: Recorded) -> Recorded {
        fused(self, b, c, false)
    }
    #[track_caller]
    fn fnma(self, b: Recorded, c: Recorded) -> Recorded {
        fused(self, b, c, true)
    }
    #[track_caller]
    fn div(self, b: Recorded) -> Recorded {
        binary(State::div, self, b)
    }
    #[track_caller]
    fn sqrt(self) -> Recorded {
        unary(State::sqrt, self)
    }
    #[track_caller]
    fn min(self, b: Recorded) -> Recorded {
        binary(State::min, self, b)
    }
    #[track_caller]
    fn max(self, b: Recorded) -> Recorded {
        binary(State::max, self, b)
    }
    #[track_caller]
    fn abs(self) -> Recorded {
        unary(State::abs, self)
    }
    #[track_caller]
    fn round(self) -> Recorded {
        unary(State::round, self)
    }
    #[track_caller]
    fn lt(self, b: Recorded) -> RecordedMask {
        RecordedMask(binary(State::lt, self, b))
    }
    #[track_caller]
    fn select(mask: RecordedMask, a: Recorded, b: Recorded) -> Recorded {
        with(Location::caller(), |s| {
            let (mask, a, b) = (s.see(mask.0), s.see(a), s.see(b));
            let x = s.select(mask, a, b);
            s.handle(x)
        })
    }
}
