//! Random numbers: the generator's bits, and what the numbers made of them are distributed like.

use sim_engine::random::{Draw, Stream, TASK_STREAMS, philox};
use sim_model::Distribution;
use sim_physics::constants::params::Param;

/// Numbers of a sample: each statistic below is known to a few thousandths.
const SAMPLE: usize = 100_000;
/// Kolmogorov and Smirnov's D is below this over √n in 999 of 1000 samples.
const KOLMOGOROV: f64 = 1.95;
/// Standard errors that a mean or a correlation may be off: one of 100 000 samples is further out.
const ERRORS: f64 = 4.5;

#[test]
fn philox_gives_the_known_answers_of_random123() {
    // kat_vectors of Random123 1.14, philox4x32 10
    let pi = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
    for (counter, key, expected) in [
        (
            [0; 4],
            [0; 2],
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8],
        ),
        (
            [u32::MAX; 4],
            [u32::MAX; 2],
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd],
        ),
        (
            pi,
            [0xa409_3822, 0x299f_31d0],
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1],
        ),
    ] {
        assert_eq!(philox(counter, key), expected);
    }
}

#[test]
fn streams_have_numbers_of_their_own_that_stay() {
    let params = Param::ALL.map(|param| Stream::Param(param).number());
    let mut all = [Stream::StartPosition, Stream::StartVelocity]
        .map(Stream::number)
        .to_vec();
    all.extend(params);
    all.extend((0..TASK_STREAMS).map(|stream| Stream::Task(stream).number()));
    all.push(Stream::ForceNoise.number());
    let count = all.len();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), count);
    assert_eq!([0, 31].map(|k| Stream::Task(k).number()), [64, 95]);
    assert!(params.iter().all(|number| number >> 31 == 1));
    // FNV-1a of "gravity" with the highest bit set, worked out apart
    assert_eq!(Stream::Param(Param::Gravity).number(), 0xd209_ff45);
}

#[test]
fn a_number_is_made_of_its_counter_as_documented() {
    let [a, b, c, d] = philox([7, 3, 1, 5], [0x89ab_cdef, 0x0123_4567]);
    let unit = |high: u32, low: u32| ((u64::from(high) << 32 | u64::from(low)) >> 11) as f64;
    let draw = Draw::new(0x0123_4567_89ab_cdef, 7, 3, Stream::StartVelocity);
    let scale = 2f64.powi(-53);
    assert_eq!(
        draw.uniform(5, -2.0, 6.0).to_bits(),
        (8.0 * scale * unit(a, b) - 2.0).to_bits()
    );
    let radius = (-2.0 * (1.0 - scale * unit(a, b)).ln()).sqrt();
    let angle = std::f64::consts::TAU * scale * unit(c, d);
    let expected = 1.0 + 0.5 * radius * angle.cos();
    // the same operations but for their order: a few roundings
    assert!((draw.normal(5, 1.0, 0.5) - expected).abs() < 8.0 * f64::EPSILON);
}

/// Numbers of many worlds, or of many indices, episodes or seeds.
fn sample(number: impl Fn(usize) -> f64) -> Vec<f64> {
    (0..SAMPLE).map(number).collect()
}

/// The same distribution, drawn along each part of the counter and the key.
fn samples(of: Distribution) -> Vec<(&'static str, Vec<f64>)> {
    let start = Stream::StartPosition;
    let along = |name, number: &dyn Fn(u32) -> f64| (name, sample(|i| number(i as u32)));
    vec![
        along("worlds", &|i| Draw::new(1, i, 0, start).sample(0, of)),
        along("episodes", &|i| Draw::new(1, 2, i, start).sample(0, of)),
        along("indices", &|i| Draw::new(1, 2, 3, start).sample(i, of)),
        along("seeds", &|i| Draw::new(i.into(), 2, 3, start).sample(0, of)),
    ]
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Largest difference between the sample's distribution and the one it is drawn from, in units of 1/√n.
fn kolmogorov(values: &[f64], cumulative: impl Fn(f64) -> f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let off = |(i, x): (usize, &f64)| {
        let p = cumulative(*x);
        (p - i as f64 / n).abs().max((p - (i + 1) as f64 / n).abs())
    };
    n.sqrt() * sorted.iter().enumerate().map(off).fold(0.0, f64::max)
}

/// Φ by Simpson's rule on its density from 0: exact to 1e-9 with 200 steps where |z| < 9.
fn normal_cumulative(z: f64) -> f64 {
    let steps = 200;
    let h = z / f64::from(steps);
    let density = |x: f64| (-0.5 * x * x).exp();
    let weight = |i: i32| [2.0, 4.0][usize::from(i % 2 == 1)];
    let inner: f64 = (1..steps)
        .map(|i| weight(i) * density(h * f64::from(i)))
        .sum();
    let integral = h / 3.0 * (density(0.0) + inner + density(z));
    0.5 + integral / std::f64::consts::TAU.sqrt()
}

#[test]
fn uniform_numbers_are_uniform_along_worlds_episodes_indices_and_seeds() {
    let (low, high) = (-0.3, 0.5);
    let std = (high - low) / 12f64.sqrt();
    for (along, values) in samples(Distribution::Uniform { low, high }) {
        assert!(values.iter().all(|x| (low..=high).contains(x)), "{along}");
        let error = (mean(&values) - 0.1).abs() / (std / (SAMPLE as f64).sqrt());
        assert!(error < ERRORS, "{along}: the mean is {error} errors off");
        let square: Vec<f64> = values.iter().map(|x| (x - 0.1).powi(2)).collect();
        // the variance of (x - mean)² is 4/5 of the squared variance
        let error = (mean(&square) / std.powi(2) - 1.0).abs() * (SAMPLE as f64 / 0.8).sqrt();
        assert!(
            error < ERRORS,
            "{along}: the variance is {error} errors off"
        );
        let d = kolmogorov(&values, |x| (x - low) / (high - low));
        assert!(d < KOLMOGOROV, "{along}: D √n is {d}");
    }
}

#[test]
fn normal_numbers_are_normal_along_worlds_episodes_indices_and_seeds() {
    let (center, std) = (0.2, 0.05);
    for (along, values) in samples(Distribution::Normal { mean: center, std }) {
        let error = (mean(&values) - center).abs() / (std / (SAMPLE as f64).sqrt());
        assert!(error < ERRORS, "{along}: the mean is {error} errors off");
        let square: Vec<f64> = values.iter().map(|x| (x - center).powi(2)).collect();
        // the variance of (x - mean)² is twice the squared variance
        let error = (mean(&square) / std.powi(2) - 1.0).abs() * (SAMPLE as f64 / 2.0).sqrt();
        assert!(
            error < ERRORS,
            "{along}: the variance is {error} errors off"
        );
        let d = kolmogorov(&values, |x| normal_cumulative((x - center) / std));
        assert!(d < KOLMOGOROV, "{along}: D √n is {d}");
    }
}

#[test]
fn numbers_of_other_worlds_dofs_episodes_streams_and_seeds_are_uncorrelated() {
    type Number = fn(u32) -> Draw;
    let (drawn, index): (Number, u32) = (|i| Draw::new(9, i, 4, Stream::StartPosition), 2);
    let others: [(&str, Number, u32); 6] = [
        ("the next dof", drawn, 3),
        (
            "the next world",
            |i| Draw::new(9, i + 1, 4, Stream::StartPosition),
            2,
        ),
        (
            "the next episode",
            |i| Draw::new(9, i, 5, Stream::StartPosition),
            2,
        ),
        (
            "the velocity",
            |i| Draw::new(9, i, 4, Stream::StartVelocity),
            2,
        ),
        (
            "the next seed",
            |i| Draw::new(10, i, 4, Stream::StartPosition),
            2,
        ),
        (
            "world 4's episodes",
            |i| Draw::new(9, 4, i, Stream::StartPosition),
            2,
        ),
    ];
    let normal = |draw: Number, index| sample(|i| draw(i as u32).normal(index, 0.0, 1.0));
    let drawn = normal(drawn, index);
    for (name, other, index) in others {
        let other = normal(other, index);
        for (kind, shape) in [
            ("", (|x| x) as fn(f64) -> f64),
            ("the square of ", |x| (x * x - 1.0) / 2f64.sqrt()),
        ] {
            let products: Vec<f64> = drawn
                .iter()
                .zip(&other)
                .map(|(a, b)| shape(*a) * shape(*b))
                .collect();
            let error = mean(&products).abs() * (SAMPLE as f64).sqrt();
            assert!(
                error < ERRORS,
                "{kind}{name}: correlation is {error} errors off"
            );
        }
    }
}
