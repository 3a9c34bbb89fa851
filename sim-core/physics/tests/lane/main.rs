//! The CPU backends: the same code gives the same bits for every width of a block.

#[path = "../../../record/tests/toy/mod.rs"]
mod toy;

use sim_physics::lane::{Cx, Lane, Num, Table, Tables};
use sim_physics::{break_if, each, push, times, when};

const POINTS: Table = Table {
    base: 0,
    stride: 2,
    rows: 4,
};
const POINTS_SCRATCH: usize = 8;

/// Code in the style of a contact solver: rows found at run time, a damped Newton iteration over
/// them that stops by itself, and blocks. Its inputs: where the points are, and a start.
#[inline(always)]
fn solve<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let c = C::F::c;
    let mut points = cx.list(POINTS.rows);
    for k in 0..6 {
        let (sin, cos) = (x[0] * c(0.7) + c(f64::from(k))).sincos();
        push!(cx, points, sin.lt(x[1]), row, {
            cx.init(POINTS, row, 0, cos);
            cx.init(POINTS, row, 1, sin * sin + c(0.5));
        });
    }
    let mut at = cx.var(x[2]);
    let mut rounds = cx.var(c(0.0));
    times!(cx, 12, {
        let here = cx.get(&at);
        let mut slope = cx.var(here - x[2]);
        let mut stiffness = cx.var(c(1.0));
        each!(cx, row in points, {
            let depth = here - cx.load(POINTS, row, 0);
            let weight = cx.load(POINTS, row, 1);
            let pushed = c(0.0).lt(depth);
            when!(cx, pushed, {
                let more = weight.fma(depth, cx.get(&slope));
                cx.set(&mut slope, more);
                let more = cx.get(&stiffness) + weight;
                cx.set(&mut stiffness, more);
            });
        });
        let step = cx.get(&slope).div(cx.get(&stiffness));
        break_if!(cx, step.abs().lt(c(1e-6)));
        cx.set(&mut at, here - step);
        let more = cx.get(&rounds) + c(1.0);
        cx.set(&mut rounds, more);
    });
    vec![cx.get(&at), cx.get(&rounds), cx.pushed(&points)]
}

const TRIPLES: Table = Table {
    base: 0,
    stride: 3,
    rows: 1,
};

/// Adds the row of a list, which only worlds with a positive input have, to -0.
#[inline(always)]
fn add_to_zero<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let c = C::F::c;
    let mut list = cx.list(TRIPLES.rows);
    push!(cx, list, c(0.0).lt(x[0]), row, {
        for k in 0..3 {
            cx.init(TRIPLES, row, k, c(0.0));
        }
    });
    let mut cell = [cx.var(c(-0.0))];
    each!(cx, row in list, {
        for k in 0..3 {
            let one = cx.or_nothing(c(1.0));
            cx.fill(TRIPLES, row, k, one);
        }
        let by = cx.only(x[0]);
        cx.add_triples(TRIPLES, row, 0, [by; 3], &mut cell);
    });
    vec![cx.get(&cell[0])]
}

fn inputs(n: usize) -> Vec<[f32; 3]> {
    toy::worlds(&mut toy::Random(11), n)
}

fn scalar(worlds: &[[f32; 3]]) -> Vec<Vec<f32>> {
    toy::on_cpu_with(
        worlds,
        POINTS_SCRATCH,
        &Tables::default(),
        |cx, x: &[f32]| solve(cx, x),
    )
}

/// A function that calls a generic one with each register type of this processor, where its instructions are allowed. It
/// returns the results with their widths.
macro_rules! in_every_width {
    ($name:ident = $generic:ident($($argument:ident: $type:ty),*) -> $result:ty) => {
        fn $name($($argument: $type),*) -> Vec<(usize, $result)> {
            #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
            unsafe fn eight($($argument: $type),*) -> $result {
                $generic::<sim_physics::lane::simd::F32x8>($($argument),*)
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f")]
            unsafe fn sixteen($($argument: $type),*) -> $result {
                $generic::<sim_physics::lane::simd::F32x16>($($argument),*)
            }
            let widths = sim_physics::lane::simd::widths();
            assert!(widths.eight, "every processor that is supported has registers of eight worlds");
            // SAFETY: the processor has the instructions (just asked)
            let narrow = (8, unsafe { eight($($argument),*) });
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as just asked
            let wide = widths.sixteen.then(|| (16, unsafe { sixteen($($argument),*) }));
            #[cfg(not(target_arch = "x86_64"))]
            let wide = None;
            if wide.is_none() {
                println!("16 worlds skipped: no AVX-512");
            }
            std::iter::once(narrow).chain(wide).collect()
        }
    };
}

mod kept;
mod sincos;

#[inline(always)]
fn solved<F: Lane<Real = f32>>(worlds: &[[f32; 3]]) -> Vec<Vec<f32>> {
    toy::on_cpu_with(worlds, POINTS_SCRATCH, &Tables::default(), |cx, x: &[F]| {
        solve(cx, x)
    })
}

#[inline(always)]
fn added<F: Lane<Real = f32>>(worlds: &[[f32; 3]]) -> Vec<Vec<f32>> {
    let (scratch, tables) = (POINTS_SCRATCH, Tables::default());
    toy::on_cpu_with(worlds, scratch, &tables, |cx, x: &[F]| add_to_zero(cx, x))
}

#[inline(always)]
fn ran<F: Lane<Real = f32>>(steps: &[toy::Step], worlds: &[[f32; toy::INPUTS]]) -> Vec<Vec<f32>> {
    toy::on_cpu::<F>(steps, worlds)
}

in_every_width!(solve_in_every_width = solved(worlds: &[[f32; 3]]) -> Vec<Vec<f32>>);
in_every_width!(add_in_every_width = added(worlds: &[[f32; 3]]) -> Vec<Vec<f32>>);
in_every_width!(run_in_every_width = ran(steps: &[toy::Step], worlds: &[[f32; toy::INPUTS]]) -> Vec<Vec<f32>>);
in_every_width!(count_down_in_every_width = counted_down(worlds: &[[f32; 1]]) -> Vec<Vec<f32>>);
in_every_width!(scatter_in_every_width = scattered() -> ());

fn bits(worlds: &[Vec<f32>]) -> Vec<Vec<u32>> {
    worlds
        .iter()
        .map(|w| w.iter().map(|x| x.to_bits()).collect())
        .collect()
}

#[test]
fn worlds_of_a_block_equal_one_bitwise() {
    // blocks that are not full, too
    for count in [27, 75] {
        let worlds = inputs(count);
        for (width, solved) in solve_in_every_width(&worlds) {
            assert_eq!(bits(&solved), bits(&scalar(&worlds)), "{width} worlds");
        }
    }
}

#[test]
fn the_text_of_these_tests_takes_every_path() {
    let results = scalar(&inputs(200));
    let column = |k: usize| results.iter().map(move |r| r[k]);
    assert!(column(1).any(|rounds| rounds == 0.0) && column(1).any(|rounds| rounds >= 3.0));
    assert!(column(2).any(|pushed| pushed == 0.0), "an empty list");
    assert!(
        column(2).any(|pushed| pushed > POINTS.rows as f32),
        "a list that overflows"
    );
}

fn scattered<F: Lane<Real = f32>>() {
    let number = |f: &dyn Fn(usize) -> usize| {
        F::load(&(0..F::WIDTH).map(|w| f(w) as f32).collect::<Vec<_>>())
    };
    let x = number(&|w| 100 + w);
    let rows = number(&|w| w * 5 % 7);
    let odd = number(&|w| w % 2);
    let mut to = vec![F::c(-1.0); 2 * 6 + 1];
    x.scatter(F::c(0.5).lt(odd), &mut to, rows, 2);
    for (place, register) in to.iter().enumerate() {
        for w in 0..F::WIDTH {
            let written = w % 2 == 1 && place == w * 5 % 7 * 2;
            let expected = if written { 100.0 + w as f32 } else { -1.0 };
            assert_eq!(register.lane(w), expected, "world {w} of register {place}");
        }
    }
    // world 4 is the only one of row 6: the memory ends before it
    let even = !F::c(0.5).lt(odd);
    let panics = |mask: F::Mask, len: usize| {
        let mut to = vec![F::c(0.0); len];
        let scatter = || x.scatter(mask, &mut to, rows, 2);
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(scatter)).is_err()
    };
    assert!(panics(even, 12) && !panics(even, 13));
    assert!(panics(F::all(), 0) && panics(F::all(), 1));
}

#[test]
fn a_world_writes_its_place_of_its_own_row_and_nothing_beyond_the_memory() {
    scatter_in_every_width();
}

#[test]
fn order_of_worlds_does_not_change_their_bits() {
    let worlds = inputs(64);
    let order: Vec<usize> = (0..64).map(|i| (i * 37 + 5) % 64).collect();
    let permuted: Vec<_> = order.iter().map(|i| worlds[*i]).collect();
    let both = solve_in_every_width(&worlds)
        .into_iter()
        .zip(solve_in_every_width(&permuted));
    for ((width, straight), (_, other)) in both {
        for (i, result) in order.iter().zip(&other) {
            let (actual, expected) = (std::slice::from_ref(result), &straight[*i..=*i]);
            assert_eq!(bits(actual), bits(expected), "{width} worlds");
        }
    }
}

/// With one zero only: `put` of a sum with `only` turns -0 into 0 where a world is inactive.
fn same_bits(worlds: &[Vec<f32>]) -> Vec<Vec<u32>> {
    worlds
        .iter()
        .map(|w| w.iter().map(|x| toy::bits(*x)).collect())
        .collect()
}

#[test]
fn random_programs_agree_bitwise_in_every_width() {
    for seed in 0..300 {
        let mut random = toy::Random(seed + 1000);
        let steps = toy::program(&mut random, 3, 4, 12);
        let worlds = toy::worlds::<{ toy::INPUTS }>(&mut random, 40);
        let expected = same_bits(&toy::on_cpu::<f32>(&steps, &worlds));
        for (width, outputs) in run_in_every_width(&steps, &worlds) {
            let outputs = same_bits(&outputs);
            assert_eq!(outputs, expected, "{width} worlds, seed {seed}: {steps:#?}");
        }
    }
}

#[test]
fn f32_agrees_with_f64() {
    let worlds = inputs(500);
    let double: Vec<[f64; 3]> = worlds.iter().map(|w| w.map(f64::from)).collect();
    let double = toy::on_cpu_with(
        &double,
        POINTS_SCRATCH,
        &Tables::default(),
        |cx, x: &[f64]| solve(cx, x),
    );
    for (single, double) in scalar(&worlds).iter().zip(&double) {
        // the iteration stops where it moves by less than 1e-6; its result is at most 3, with some
        // ten roundings behind each of six rows
        let tolerance = 1e-6 + 60.0 * 3.0 * f64::from(f32::EPSILON) / 2.0;
        let error = (f64::from(single[0]) - double[0]).abs();
        assert!(error < tolerance, "{single:?} instead of {double:?}");
        assert_eq!(f64::from(single[2]), double[2], "rows pushed");
    }
}

/// A world that stops keeps what it had, however long its neighbours go on.
fn countdown<C: Cx>(cx: &mut C, x: &[C::F]) -> Vec<C::F> {
    let mut rounds = cx.var(C::F::c(0.0));
    times!(cx, 100, {
        break_if!(cx, x[0].lt(cx.get(&rounds) + C::F::c(1.0)));
        let more = cx.get(&rounds) + C::F::c(1.0);
        cx.set(&mut rounds, more);
    });
    vec![cx.get(&rounds)]
}

fn counted_down<F: Lane<Real = f32>>(worlds: &[[f32; 1]]) -> Vec<Vec<f32>> {
    toy::on_cpu_with(worlds, 0, &Tables::default(), |cx, x: &[F]| {
        countdown(cx, x)
    })
}

#[test]
fn a_world_that_stopped_does_not_move_with_its_neighbours() {
    let worlds: Vec<[f32; 1]> = (0..48).map(|i| [(i * 7 % 48) as f32]).collect();
    let expected: Vec<Vec<f32>> = worlds.iter().map(|x| x.to_vec()).collect();
    assert_eq!(counted_down::<f32>(&worlds), expected);
    for (width, counted) in count_down_in_every_width(&worlds) {
        assert_eq!(counted, expected, "{width} worlds");
    }
}

#[test]
fn rows_that_do_not_fit_are_counted_and_not_stored() {
    let table = Table {
        base: 1,
        stride: 1,
        rows: 2,
    };
    let mut memory = vec![-1.0f64; 4];
    let tables = Tables::default();
    let mut machine = sim_physics::lane::memory::Cpu::new(&mut memory, &tables);
    let cx = &mut machine;
    let mut list = cx.list(2);
    for k in 0..5 {
        push!(cx, list, 0.5f64.lt(f64::from(k)), row, {
            cx.init(table, row, 0, f64::from(k))
        });
    }
    assert_eq!(cx.pushed(&list), 4.0);
    let mut rounds = 0;
    each!(cx, _row in list, { rounds += 1 });
    assert_eq!(rounds, 2);
    assert_eq!(memory, [-1.0, 1.0, 2.0, -1.0]);
}

#[test]
#[should_panic(expected = "out of bounds")]
fn a_row_beyond_the_scratch_memory_is_not_reached() {
    let mut memory = [0.0f64; 4];
    let tables = Tables::default();
    let mut cx = sim_physics::lane::memory::Cpu::new(&mut memory, &tables);
    let row = cx.at(2);
    let _ = cx.load(
        Table {
            base: 0,
            stride: 2,
            rows: 3,
        },
        row,
        1,
    );
}

#[cfg(debug_assertions)]
#[test]
#[should_panic(expected = "row 2")]
fn a_row_outside_its_table_is_found_in_debug_builds() {
    let mut memory = [0.0f64; 8];
    let tables = Tables::default();
    let mut cx = sim_physics::lane::memory::Cpu::new(&mut memory, &tables);
    let row = cx.at(2);
    let _ = cx.load(
        Table {
            base: 0,
            stride: 2,
            rows: 2,
        },
        row,
        1,
    );
}

#[test]
fn what_other_worlds_add_leaves_the_sign_of_a_zero() {
    let worlds: Vec<[f32; 3]> = (0..16).map(|k| [k as f32 - 7.5, 0.0, 0.0]).collect();
    for (width, sums) in add_in_every_width(&worlds) {
        for (world, sum) in worlds.iter().zip(&sums) {
            let expected = if world[0] > 0.0 { 3.0 * world[0] } else { -0.0 };
            assert_eq!(
                sum[0].to_bits(),
                expected.to_bits(),
                "{width} worlds: {world:?}"
            );
        }
    }
}
