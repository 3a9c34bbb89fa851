//! The project's own sine and cosine.

use crate::toy;
use sim_physics::lane::{Lane, Num};

in_every_width!(sincos_in_every_width = sincos(x: &[f32]) -> Vec<(f32, f32)>);

#[inline(always)]
fn sincos<F: Lane<Real = f32>>(x: &[f32]) -> Vec<(f32, f32)> {
    let mut results = Vec::new();
    for block in x.chunks(F::WIDTH) {
        let mut padded = block.to_vec();
        padded.resize(F::WIDTH, 0.0);
        let (sin, cos) = F::load(&padded).sincos();
        let (mut s, mut c) = (padded.clone(), padded);
        sin.store(&mut s);
        cos.store(&mut c);
        results.extend(s.into_iter().zip(c).take(block.len()));
    }
    results
}

/// Random angles up to a limit, and those near multiples of π/2 and π/4, where reductions fail.
fn angles(limit: f64) -> Vec<f64> {
    let mut random = toy::Random(5);
    let mut angles = vec![0.0, -0.0, 1e-30, -1e-8, limit, -limit];
    for _ in 0..100_000 {
        angles.push(random.unit() * limit);
        angles.push(random.unit() * 4.0);
    }
    let quarters = (limit / std::f64::consts::FRAC_PI_4) as usize;
    for _ in 0..50_000 {
        let near = random.below(quarters) as f64 * std::f64::consts::FRAC_PI_4;
        angles.push(near + random.unit() * near * 1e-7);
        angles.push(near * (1.0 + f64::EPSILON * random.below(4) as f64));
    }
    angles
}

#[test]
fn sincos_in_f32_is_good_to_an_ulp_of_one_up_to_ten_thousand() {
    let angles: Vec<f32> = angles(1e4).into_iter().map(|x| x as f32).collect();
    let mut worst = 0.0f64;
    for (x, (sin, cos)) in angles.iter().zip(sincos::<f32>(&angles)) {
        let (s, c) = f64::from(*x).sin_cos();
        worst = worst
            .max((f64::from(sin) - s).abs())
            .max((f64::from(cos) - c).abs());
    }
    // half an ulp of the result's rounding, as much for the polynomial's, below 1
    assert!(worst <= f64::from(f32::EPSILON), "{worst:e}");
}

#[test]
fn sincos_in_f64_is_good_to_an_ulp_of_one_up_to_ten_thousand() {
    let mut worst = 0.0f64;
    for x in angles(1e4) {
        let (sin, cos) = Num::sincos(x);
        let (s, c) = x.sin_cos();
        worst = worst.max((sin - s).abs()).max((cos - c).abs());
    }
    assert!(worst <= f64::EPSILON, "{worst:e}");
}

#[test]
fn sine_near_zero_is_good_relatively() {
    for k in -30..0 {
        let x = 2f32.powi(k) * 1.3;
        let (sin, cos) = Num::sincos(x);
        assert!((f64::from(sin) / f64::from(x).sin() - 1.0).abs() < f64::from(f32::EPSILON));
        assert!((f64::from(cos) - f64::from(x).cos()).abs() < f64::from(f32::EPSILON));
    }
}

#[test]
fn sincos_is_bitwise_the_same_in_every_width() {
    let angles: Vec<f32> = angles(1e6).into_iter().map(|x| x as f32).collect();
    let expected = sincos::<f32>(&angles);
    let bits = |(s, c): (f32, f32)| (s.to_bits(), c.to_bits());
    for (width, results) in sincos_in_every_width(&angles) {
        let same = results
            .into_iter()
            .zip(&expected)
            .all(|(a, b)| bits(a) == bits(*b));
        assert!(same, "{width} worlds");
    }
}
