//! Activations of a row, without branches and library calls where that matters, so that registers hold many values.
//!
//! NaN stays NaN: what the policy made of a broken world must show.

use crate::network::Layer;

/// Beyond these arguments exp overflows, or is less than any number above 0.
const EXP_ARGUMENT: (f32, f32) = (-87.33654, 88.72283);
/// log₂ e, and ln 2 as the sum of a number with few bits and the rest (Cody and Waite 1980).
const LOG2_E: f32 = std::f32::consts::LOG2_E;
const LN_2: (f32, f32) = (0.693_359_4, -2.121_944_4e-4);
/// Of exp(r) - 1 - r over r², |r| < ln 2 / 2 (Cephes, `expf.c`), the highest power first.
const EXP: [f32; 6] = [
    1.987_569_1e-4,
    1.398_199_9e-3,
    8.333_452e-3,
    4.166_579_6e-2,
    1.666_666_5e-1,
    0.5,
];
/// Adding and subtracting it rounds to a whole number: 1.5 · 2²³.
const ROUND: f32 = 12_582_912.0;

/// exp(x) to 2 units in the last place.
#[inline(always)]
fn exp(x: f32) -> f32 {
    let x = x.clamp(EXP_ARGUMENT.0, EXP_ARGUMENT.1);
    let rounded = LOG2_E.mul_add(x, ROUND);
    let whole = rounded - ROUND;
    let rest = (-LN_2.1).mul_add(whole, (-LN_2.0).mul_add(whole, x));
    let mut sum = EXP[0];
    for coefficient in &EXP[1..] {
        sum = sum.mul_add(rest, *coefficient);
    }
    let power = sum.mul_add(rest * rest, rest + 1.0);
    // 2^whole by its bits, in two factors: the largest is beyond all numbers
    let steps = (rounded.to_bits() as i32).wrapping_sub(ROUND.to_bits() as i32);
    let half = steps >> 1;
    let scale = |steps: i32| f32::from_bits((steps.wrapping_add(127) << 23) as u32);
    power * scale(half) * scale(steps.wrapping_sub(half))
}

#[inline(always)]
fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

#[inline(always)]
fn tanh(x: f32) -> f32 {
    // beyond, single precision has ±1
    let x = x.clamp(-10.0, 10.0);
    let far = 1.0 - 2.0 / (exp(2.0 * x) + 1.0);
    // near 0 the difference loses digits: x - x³/3 + 2 x⁵/15 - 17 x⁷/315
    let square = x * x;
    let series = (-17.0f32 / 315.0).mul_add(square, 2.0 / 15.0);
    let series = series.mul_add(square, -1.0 / 3.0) * square;
    let near = series.mul_add(x, x);
    if square < 0.04 { near } else { far }
}

#[inline(always)]
fn elu(x: f32, alpha: f32) -> f32 {
    // near 0 the difference loses digits: x + x²/2 + x³/6 + x⁴/24
    let near = (1.0f32 / 24.0).mul_add(x, 1.0 / 6.0).mul_add(x, 0.5) * x;
    let near = near.mul_add(x, x);
    let below = if x > -0.03 { near } else { exp(x) - 1.0 };
    if x > 0.0 { x } else { alpha * below }
}

#[inline(always)]
fn softplus(x: f32) -> f32 {
    let above = if x < 0.0 { 0.0 } else { x };
    above + libm::log1pf(exp(if x < 0.0 { x } else { -x }))
}

/// Applies a layer other than a linear one to a row; `parameters` are as long as the row, or empty.
#[inline(always)]
pub(crate) fn apply(layer: Layer, parameters: &[f32], row: &mut [f32]) {
    #[inline(always)]
    fn each(row: &mut [f32], change: impl Fn(f32) -> f32) {
        for value in row {
            *value = change(*value);
        }
    }
    #[inline(always)]
    fn with(row: &mut [f32], parameters: &[f32], join: impl Fn(f32, f32) -> f32) {
        for (value, &parameter) in row.iter_mut().zip(parameters) {
            *value = join(*value, parameter);
        }
    }
    match layer {
        Layer::Linear { .. } => {}
        Layer::Add => with(row, parameters, |x, c| x + c),
        Layer::Subtract => with(row, parameters, |x, c| x - c),
        Layer::Multiply => with(row, parameters, |x, c| x * c),
        Layer::Divide => with(row, parameters, |x, c| x / c),
        Layer::Clip { low, high } => each(row, |x| x.clamp(low, high)),
        Layer::Relu => each(row, |x| if x < 0.0 { 0.0 } else { x }),
        Layer::LeakyRelu { slope } => each(row, |x| if x < 0.0 { slope * x } else { x }),
        Layer::Elu { alpha, scale: 1.0 } => each(row, |x| elu(x, alpha)),
        Layer::Elu { alpha, scale } => each(row, |x| scale * elu(x, alpha)),
        Layer::Tanh => each(row, tanh),
        Layer::Sigmoid => each(row, sigmoid),
        Layer::Softplus => each(row, softplus),
        Layer::Silu => each(row, |x| x * sigmoid(x)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applied(layer: Layer, x: f32) -> f32 {
        let mut row = [x];
        apply(layer, &[], &mut row);
        row[0]
    }

    /// An activation and what it is.
    type Case = (Layer, fn(f64) -> f64);

    const CASES: [Case; 6] = [
        (Layer::Tanh, f64::tanh),
        (Layer::Sigmoid, |x| 1.0 / (1.0 + (-x).exp())),
        (Layer::Softplus, |x| x.max(0.0) + (-x.abs()).exp().ln_1p()),
        (Layer::Silu, |x| x / (1.0 + (-x).exp())),
        (
            Layer::Elu {
                alpha: 1.0,
                scale: 1.0,
            },
            |x| if x > 0.0 { x } else { x.exp_m1() },
        ),
        (
            Layer::Elu {
                alpha: 1.5,
                scale: 2.0,
            },
            |x| 2.0 * if x > 0.0 { x } else { 1.5 * x.exp_m1() },
        ),
    ];

    #[test]
    fn activations_are_exact_to_single_precision() {
        for (layer, exact) in CASES {
            for step in -40_000..=40_000 {
                let x = step as f32 / 400.0;
                let (made, wanted) = (f64::from(applied(layer, x)), exact(f64::from(x)));
                // differences of numbers of about 1, times at most 3; a handful of roundings
                let tolerance = 4.0 * f64::from(f32::EPSILON) * wanted.abs().max(1.0);
                assert!(
                    (made - wanted).abs() <= tolerance,
                    "{layer:?} of {x}: {made} {wanted}"
                );
            }
        }
    }

    #[test]
    fn extremes_have_their_limits_and_nan_stays() {
        let extremes = [f32::INFINITY, 1e30, 100.0, 89.0];
        for x in extremes {
            assert_eq!(applied(Layer::Tanh, x), 1.0);
            assert_eq!(applied(Layer::Tanh, -x), -1.0);
            assert_eq!(applied(Layer::Sigmoid, x), 1.0);
            assert!(applied(Layer::Sigmoid, -x) < 1e-37);
            assert_eq!(applied(CASES[4].0, -x), -1.0);
            assert_eq!(applied(Layer::Softplus, x), x);
        }
        let others = [
            Layer::Relu,
            Layer::LeakyRelu { slope: 0.1 },
            Layer::Clip {
                low: -1.0,
                high: 1.0,
            },
        ];
        for layer in CASES.map(|(layer, _)| layer).into_iter().chain(others) {
            assert!(applied(layer, f32::NAN).is_nan(), "{layer:?}");
        }
    }
}
