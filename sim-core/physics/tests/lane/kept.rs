//! Tables of the model and kept lists on the CPU backends.

use crate::toy::{self, contacts};
use crate::{bits, inputs};
use sim_physics::lane::{Cx, Lane, Table, Tables};
use sim_physics::push;

/// Results of the texts of [`contacts`].
#[inline(always)]
fn contacts_of<F: Lane>(worlds: &[[F::Real; 3]]) -> Vec<Vec<F::Real>> {
    toy::on_cpu_with(
        worlds,
        contacts::SCRATCH,
        &contacts::tables(),
        |cx, x: &[F]| contacts::both(cx, x),
    )
}

in_every_width!(contacts_in_every_width = contacts_of(worlds: &[[f32; 3]]) -> Vec<Vec<f32>>);

#[test]
fn the_texts_of_these_tests_take_every_path() {
    // rows of three kept lists with room for 3, 1 and 0
    let results = contacts_of::<f32>(&inputs(200));
    let column = |k: usize| results.iter().map(move |r| r[k]);
    for (kind, room) in [3.0, 1.0, 0.0].into_iter().enumerate() {
        assert!(column(kind).any(|pushed| pushed == 0.0));
        assert!(column(kind).any(|pushed| pushed > room));
    }
    assert!(column(0).any(|pushed| pushed > 0.0 && pushed < 3.0));
    assert!(column(5).any(|largest| largest > 0.0) && column(5).any(|largest| largest == 0.0));
}

#[test]
fn kept_lists_are_bitwise_the_same_in_every_width_and_order() {
    let worlds = inputs(200);
    let order: Vec<usize> = (0..200).map(|i| (i * 37 + 5) % 200).collect();
    let permuted: Vec<_> = order.iter().map(|i| worlds[*i]).collect();
    let expected = bits(&contacts_of::<f32>(&worlds));
    for (width, contacts) in contacts_in_every_width(&worlds) {
        assert_eq!(bits(&contacts), expected, "{width} worlds");
    }
    for (width, contacts) in contacts_in_every_width(&permuted) {
        for (i, result) in order.iter().zip(&bits(&contacts)) {
            assert_eq!(result, &expected[*i], "{width} worlds");
        }
    }
}

#[test]
fn kept_lists_in_f64_hold_the_rows_of_f32() {
    let worlds = inputs(500);
    let double: Vec<[f64; 3]> = worlds.iter().map(|w| w.map(f64::from)).collect();
    for (single, double) in contacts_of::<f32>(&worlds)
        .iter()
        .zip(contacts_of::<f64>(&double))
    {
        for (a, b) in single.iter().zip(&double) {
            // at most four rows of 3.7 stiffness by 4 depth, each of three roundings
            let tolerance = 4.0 * 16.0 * 3.0 * f64::from(f32::EPSILON);
            assert!(
                (f64::from(*a) - b).abs() < tolerance,
                "{single:?}, {double:?}"
            );
        }
    }
}

#[test]
fn two_handles_on_a_kept_list_agree() {
    let counts = Table {
        base: 0,
        stride: 1,
        rows: 2,
    };
    let rows = Table {
        base: 2,
        stride: 1,
        rows: 4,
    };
    let mut memory = vec![0.0f64; 6];
    let tables = Tables::default();
    let mut machine = sim_physics::lane::memory::Cpu::new(&mut memory, &tables);
    let cx = &mut machine;
    let (mut a, mut b) = (cx.kept(counts, 1, 1, 2), cx.kept(counts, 1, 1, 2));
    push!(cx, a, true, row, { cx.init(rows, row, 0, 5.0) });
    push!(cx, b, true, row, { cx.init(rows, row, 0, 6.0) });
    push!(cx, a, true, row, { cx.init(rows, row, 0, 7.0) });
    assert_eq!((cx.pushed(&a), cx.pushed(&b)), (3.0, 3.0));
    assert_eq!(memory, [0.0, 3.0, 0.0, 5.0, 6.0, 0.0]);
}
