//! Products of vectors, and updates of a factor, against the matrices.

use super::super::{cones, turning};
use super::roots::Roots;
use super::update;
use crate::constants::contact::Cone;
use crate::lane::Tables;
use crate::lane::memory::Cpu;
use crate::math::factor::{Pattern, UpdatePath, decompose};

const IMPRATIO: f64 = 30.0;
const STIFF: f64 = 2.0;
const MU: f64 = 0.7;

/// A residual from a number: separated, sticking or sliding; every eighth has no slip.
fn residual<const N: usize>(seed: usize) -> [f64; N] {
    let mut jar = [0.0; N];
    for (k, x) in jar.iter_mut().enumerate() {
        *x = ((seed * 7 + k * 5) as f64).sin();
    }
    jar[0] *= [0.5, 3.0, 20.0][seed % 3];
    if seed.is_multiple_of(8) {
        jar[1..].fill(0.0);
    }
    jar
}

/// Entries (c, d) of Σ w u uᵀ.
fn sum<const N: usize>(roots: &Roots<f64, N>, cone: Cone) -> [[f64; N]; N] {
    let columns: Vec<[f64; N]> = (0..N)
        .map(|c| {
            let mut unit = [0.0; N];
            unit[c] = 1.0;
            roots.vectors(cone, unit)
        })
        .collect();
    let mut sum = [[0.0; N]; N];
    for (c, row) in sum.iter_mut().enumerate() {
        for (d, entry) in row.iter_mut().enumerate() {
            *entry = (0..N)
                .map(|n| roots.weights[n] * columns[c][n] * columns[d][n])
                .sum();
        }
    }
    sum
}

fn assert_same<const N: usize>(sum: [[f64; N]; N], stiffness: [[f64; N]; N], what: &str) {
    for (x, y) in sum.as_flattened().iter().zip(stiffness.as_flattened()) {
        assert!(
            (x - y).abs() < 1e-12 * (1.0 + y.abs()),
            "{what}: {sum:?}, expected {stiffness:?}"
        );
    }
}

fn soft() -> f64 {
    STIFF / (1.0 + MU * MU / IMPRATIO)
}

#[test]
fn roots_add_up_to_the_stiffness_of_three_rows() {
    let mut states = [0; 3];
    for seed in 0..200 {
        let jar = residual::<3>(seed);
        let holds = seed.is_multiple_of(5).then_some(true);
        let law = cones::elliptic::<f64>(IMPRATIO, jar, [STIFF, soft(), MU], holds);
        states[law.state as usize] += 1;
        let elliptic = Roots::elliptic(jar, law.state, [STIFF, STIFF * IMPRATIO, soft(), MU]);
        let pyramid = cones::pyramidal(jar, STIFF, MU);
        let pyramidal = Roots::pyramidal(jar, [STIFF; 3], MU);
        for (law, roots, cone) in [
            (law, elliptic, Cone::Elliptic),
            (pyramid, pyramidal, Cone::Pyramidal),
        ] {
            let [nn, nx, ny, xx, xy, yy] = law.stiffness;
            let stiffness = [[nn, nx, ny], [nx, xx, xy], [ny, xy, yy]];
            assert_same(sum(&roots, cone), stiffness, &format!("{cone:?} {jar:?}"));
        }
    }
    assert!(states.iter().all(|&count| count > 20), "{states:?}");
}

#[test]
fn roots_add_up_to_the_stiffness_of_six_rows() {
    for seed in 0..200 {
        let jar = residual::<6>(seed);
        let exists = [1.0, f64::from(seed as u32 % 2), 0.0];
        let law = turning::elliptic::<f64>(IMPRATIO, jar, [STIFF, soft(), MU], None);
        let elliptic = Roots::elliptic(jar, law.state, [STIFF, STIFF * IMPRATIO, soft(), MU]);
        let pyramid = turning::pyramidal(jar, STIFF, MU, exists);
        let mut stiff = [STIFF; 6];
        for k in 0..3 {
            stiff[k + 3] *= exists[k];
        }
        let pyramidal = Roots::pyramidal(jar, stiff, MU);
        for (law, roots, cone) in [
            (law, elliptic, Cone::Elliptic),
            (pyramid, pyramidal, Cone::Pyramidal),
        ] {
            let mut stiffness = [[0.0; 6]; 6];
            for (c, column) in stiffness.iter_mut().enumerate() {
                let mut unit = [0.0; 6];
                unit[c] = 1.0;
                *column = law.times(unit);
            }
            assert_same(sum(&roots, cone), stiffness, &format!("{cone:?} {jar:?}"));
        }
    }
}

/// Updates of the factor of a matrix with these entries, by vectors that are 0 but for some rows.
fn check(size: usize, entries: &[(usize, usize)], rows: &[usize]) {
    let pattern = Pattern::new(size, entries.iter().copied());
    let mut matrix = vec![0.0; pattern.len()];
    for &(i, j) in entries {
        matrix[pattern.at(i.max(j), i.min(j))] = ((i * 7 + j * 3) as f64).sin();
    }
    for k in 0..size {
        matrix[pattern.at(k, k)] = 20.0 + k as f64;
    }
    let path = UpdatePath::new(&pattern, rows);
    let column = |place: usize| [0, 1, 2].map(|n| ((place * 3 + n) as f64).cos());
    let weights = [1e6, 0.3, 0.0];
    let mut factor = matrix.clone();
    decompose(&pattern, &mut factor);
    let mut vectors = vec![[0.0; 3]; 2 * size];
    for (v, source) in vectors.iter_mut().zip(path.sources()) {
        *v = source.map_or([0.0; 3], column);
    }
    let tables = Tables {
        numbers: Vec::new(),
        indices: Vec::new(),
    };
    let mut cx = Cpu::<f64>::new(&mut [], &tables);
    update(&mut cx, &path, &mut factor, weights, &mut vectors);
    for (a, &i) in rows.iter().enumerate() {
        for (b, &j) in rows.iter().enumerate().filter(|(_, j)| **j <= i) {
            let (x, y) = (column(a), column(b));
            let sum: f64 = (0..3).map(|n| weights[n] * x[n] * y[n]).sum();
            matrix[pattern.at(i, j)] += sum;
        }
    }
    decompose(&pattern, &mut matrix);
    for (x, y) in factor.iter().zip(&matrix) {
        assert!((x - y).abs() < 1e-9 * (1e-3 + y.abs()), "{x}, expected {y}");
    }
}

#[test]
fn updates_of_a_factor_give_the_factor_of_the_sum() {
    let full = |size: usize| (0..size).flat_map(|i| (0..i).map(move |j| (i, j)));
    // a full block, and a part of it
    check(8, &full(8).collect::<Vec<_>>(), &[0, 1, 2, 3, 4, 5, 6, 7]);
    check(8, &full(8).collect::<Vec<_>>(), &[2, 5]);
    // a trunk of 3 with two legs: a path, and a part of one
    let mut tree: Vec<_> = full(3).collect();
    for first in [3, 7] {
        for k in first..first + 4 {
            tree.extend((0..3).chain(first..k).map(|i| (k, i)));
        }
    }
    check(11, &tree, &[0, 1, 2, 7, 8, 9, 10]);
    check(11, &tree, &[8, 9]);
    // a coupling of the legs fills the rows between
    let coupled: Vec<_> = tree
        .iter()
        .copied()
        .chain([(9, 5), (9, 4), (8, 5), (8, 4)])
        .collect();
    check(11, &coupled, &[4, 5, 8, 9]);
    check(11, &coupled, &[0, 1, 2, 3]);
    // beside another robot
    let others: Vec<_> = (tree.iter().map(|(i, j)| (i + 2, j + 2)))
        .chain([(1, 0)])
        .collect();
    check(13, &others, &[2, 3, 4, 5]);
    check(13, &others, &[0, 1]);
}
