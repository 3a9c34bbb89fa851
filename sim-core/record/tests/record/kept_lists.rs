//! Tables of the model, spans, and kept lists: those that outlast their recording.

use crate::toy::{self, contacts};
use crate::{TABLE, accepted, c, refused};
use sim_physics::lane::{Cx, Fixed, Num, Table, Tables};
use sim_physics::{break_if, each, push, span, times, when};
use sim_record::wgsl::{ProgramOptions, wgsl};
use sim_record::{Misuse, Recorded, Recorder, Recording, record};

const FIXED: Fixed = Fixed {
    base: 1,
    stride: 2,
    rows: 3,
};
const COUNTS: Table = Table {
    base: 8,
    stride: 1,
    rows: 2,
};

fn tables() -> Tables<f32> {
    Tables {
        numbers: vec![-1.0, 10.0, 11.0, 20.0, 21.0, 30.0, 31.0],
        indices: vec![9, 0, 2, 1, 3, 2, 2],
    }
}

fn evaluated(recording: &Recording, inputs: [f32; 2]) -> Vec<f32> {
    recording.evaluate(&inputs, &mut [0.0; 16], &tables())
}

/// List `at`, with room for two rows of [`TABLE`] from `first` on.
fn list(cx: &mut Recorder, at: usize, first: usize) -> <Recorder as Cx>::List {
    let (at, first, capacity) = (cx.at(at), cx.at(first), cx.at(2));
    cx.kept(COUNTS, at, first, capacity)
}

#[test]
fn kept_lists_pass_rows_from_one_program_to_the_next() {
    let find = record(contacts::INPUTS, contacts::find).expect("a correct text is recorded");
    let solve = record(contacts::INPUTS, contacts::solve).expect("a correct text is recorded");
    for recording in [&find, &solve] {
        let program = wgsl(recording, &ProgramOptions::default());
        toy::validated(&program);
        assert_eq!(recording.scratch(), contacts::SCRATCH);
        // tables are bound, and never written into the program
        for line in [
            "@group(0) @binding(2) var<storage, read> numbers: array<f32>;",
            "@group(0) @binding(3) var<storage, read> indices: array<u32>;",
        ] {
            assert!(program.contains(line), "{line} is not in\n{program}");
        }
        assert!(!program.contains("const "), "{program}");
    }
    let worlds = toy::worlds::<{ contacts::INPUTS }>(&mut toy::Random(21), 300);
    let tables = contacts::tables();
    let scalar = toy::on_cpu_with(&worlds, contacts::SCRATCH, &tables, |cx, x: &[f32]| {
        contacts::both(cx, x)
    });
    let mut overflows = 0;
    for (world, expected) in worlds.iter().zip(&scalar) {
        let mut scratch = [0.0; contacts::SCRATCH];
        let mut got = find.evaluate(world, &mut scratch, &tables);
        got.extend(solve.evaluate(world, &mut scratch, &tables));
        overflows += usize::from(got[0] > 3.0 && got[1] > 1.0);
        let bits = |x: &[f32]| x.iter().map(|x| toy::bits(*x)).collect::<Vec<_>>();
        assert_eq!(bits(&got), bits(expected), "{got:?}, not {expected:?}");
    }
    assert!(overflows > 10, "two lists overflow in {overflows} worlds");
}

#[test]
fn tables_are_read_where_the_index_says() {
    let good = accepted(|cx, x| {
        let (i, last) = (cx.at(1), cx.at(2));
        let named = cx.index(FIXED, i, 0, 4);
        let number = cx.number(named);
        let row = cx.index(FIXED, last, 1, 3);
        vec![
            number,
            cx.constant(FIXED, i, 1),
            cx.constant(FIXED, row, 0),
            cx.pick(FIXED, x[0], 1),
            cx.pick(FIXED, c(7.0), 0),
        ]
    });
    // base 1, rows of two: index 1, 0 stands at 3
    let picked = |row| evaluated(&good, [row, 0.0])[3];
    assert_eq!(evaluated(&good, [1.0, 0.0])[..3], [1.0, 21.0, 30.0][..]);
    assert_eq!([-5.0, 0.0, 2.0, 9.0].map(picked), [11.0, 11.0, 31.0, 31.0]);
    assert_eq!(evaluated(&good, [1.0, 0.0])[4], 30.0);
}

#[test]
#[should_panic(expected = "index 3 of")]
fn an_index_that_is_not_below_its_end_is_found() {
    let good = accepted(|cx, _| {
        let i = cx.at(1);
        let named = cx.index(FIXED, i, 1, 3);
        vec![cx.number(named)]
    });
    evaluated(&good, [0.0, 0.0]);
}

#[test]
fn what_the_model_holds_is_read_once() {
    let good = accepted(|cx, x| {
        let i = cx.at(0);
        let mut sum = cx.var(x[0]);
        let first = cx.constant(FIXED, i, 0);
        times!(cx, 3, {
            let (again, named) = (cx.constant(FIXED, i, 0), cx.index(FIXED, i, 0, 3));
            let more = cx.get(&sum) + first * again + cx.constant(FIXED, named, 1);
            let same = cx.index(FIXED, i, 0, 3);
            let more = more + cx.constant(FIXED, same, 1);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    // one input; a constant before the loop, an index and a constant inside
    assert_eq!(good.statements().loads, 1 + 3, "{:?}", good.statements());
    // a constant on which nothing depends is not read, and its table is not bound
    let good = accepted(|cx, x| {
        let i = cx.at(0);
        let named = cx.index(FIXED, i, 0, 3);
        let _unused = cx.constant(FIXED, named, 0);
        vec![x[0]]
    });
    assert_eq!(good.statements().loads, 1);
    assert!(!wgsl(&good, &ProgramOptions::default()).contains("@binding(2)"));
}

#[test]
fn a_span_runs_from_its_first_index_to_before_its_end() {
    let good = accepted(|cx, x| {
        let mut digits = cx.var(c(0.0));
        let row = cx.at(1);
        let (first, end) = (cx.index(FIXED, row, 0, 3), cx.index(FIXED, row, 1, 4));
        let three = cx.at(3);
        span!(cx, i in first, three, {
            let more = cx.get(&digits) * c(10.0) + cx.number(i);
            let beyond = x[0].lt(cx.number(i));
            break_if!(cx, beyond);
            cx.set(&mut digits, more);
        });
        // the end lies before the first: no iteration
        span!(cx, i in three, end, {
            let more = cx.number(i);
            cx.set(&mut digits, more);
        });
        span!(cx, i in end, first, {
            let more = cx.get(&digits) * c(10.0) + cx.number(i) + c(5.0);
            cx.set(&mut digits, more);
        });
        vec![cx.get(&digits)]
    });
    let tables = |first, end| Tables {
        numbers: vec![],
        indices: vec![0, 0, 0, first, end, 0, 0],
    };
    let digits = |x, first, end| good.evaluate(&[x, 0.0], &mut [], &tables(first, end))[0];
    assert_eq!(digits(9.0, 1, 3), 12.0);
    assert_eq!(digits(9.0, 2, 0), 256.0);
    assert_eq!(digits(1.0, 0, 3), 1.0);
}

#[test]
fn rows_that_do_not_fit_a_kept_list_are_counted_and_not_stored() {
    let good = accepted(|cx, x| {
        let mut kept = list(cx, 1, 1);
        for k in 0..4 {
            push!(cx, kept, x[0].lt(c(f64::from(k))), row, {
                cx.init(TABLE, row, 0, c(f64::from(k)));
            });
        }
        let mut digits = cx.var(c(0.0));
        each!(cx, row in kept, {
            let more = cx.get(&digits) * c(10.0) + cx.load(TABLE, row, 0);
            cx.set(&mut digits, more);
        });
        vec![cx.pushed(&kept), cx.get(&digits)]
    });
    let run = |x| {
        let mut scratch = [7.0; 10];
        scratch[8..].fill(0.0);
        let results = good.evaluate(&[x, 0.0], &mut scratch, &tables());
        (results, scratch)
    };
    let (results, scratch) = run(-1.0);
    assert_eq!(results, [4.0, 1.0]);
    assert_eq!(scratch, [7.0, 7.0, 0.0, 7.0, 1.0, 7.0, 7.0, 7.0, 0.0, 4.0]);
    assert_eq!(run(1.5).0, [2.0, 23.0]);
    assert_eq!(run(2.5).0, [1.0, 3.0]);
    assert_eq!(run(9.0).0, [0.0, 0.0]);
}

#[test]
fn a_push_forgets_what_it_may_have_changed() {
    let good = accepted(|cx, x| {
        let (zero, one) = (cx.at(0), cx.at(1));
        cx.store(COUNTS, zero, 0, c(0.0));
        cx.store(TABLE, zero, 0, x[0]);
        cx.store(TABLE, one, 0, x[0]);
        let (mut kept, other) = (list(cx, 0, 0), list(cx, 0, 0));
        let before = cx.pushed(&other);
        push!(cx, kept, x[0].lt(x[1]), row, {
            cx.init(TABLE, row, 0, x[1])
        });
        push!(cx, kept, x[0].lt(x[1]), row, {
            cx.init(TABLE, row, 0, x[1])
        });
        vec![
            before,
            cx.pushed(&other),
            cx.load(COUNTS, zero, 0),
            cx.load(TABLE, zero, 0),
            cx.load(TABLE, one, 0),
        ]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [0.0, 2.0, 2.0, 5.0, 5.0]);
    assert_eq!(evaluated(&good, [5.0, 3.0]), [0.0, 0.0, 0.0, 5.0, 5.0]);
}

#[test]
fn row_of_a_kept_list_used_out_of_place_is_refused() {
    let misuse = refused(|cx, x| {
        let mut kept = list(cx, 0, 0);
        let mut outside = None;
        push!(cx, kept, x[0].lt(x[1]), row, { outside = Some(row) });
        cx.init(
            TABLE,
            outside.expect("the recorder runs every block"),
            0,
            x[0],
        );
        vec![]
    });
    assert_eq!(misuse, Misuse::RowAfterBlock);
    // filled in the block of another list, kept or not
    let misuse = refused(|cx, x| {
        let (mut a, mut b) = (list(cx, 0, 0), list(cx, 1, 1));
        push!(cx, a, x[0].lt(x[1]), row_a, {
            push!(cx, b, x[1].lt(c(2.0)), _row_b, {
                cx.init(TABLE, row_a, 0, x[0]);
            });
        });
        vec![]
    });
    assert_eq!(misuse, Misuse::RowOfAnotherList);
    let misuse = refused(|cx, x| {
        let (mut a, mut b) = (list(cx, 0, 0), cx.list(3));
        push!(cx, b, x[0].lt(x[1]), row_b, {
            push!(cx, a, x[1].lt(c(2.0)), _row_a, {
                cx.init(TABLE, row_b, 0, x[0]);
            });
        });
        vec![]
    });
    assert_eq!(misuse, Misuse::RowOfAnotherList);
    // read in a loop over a list of other counts
    let misuse = refused(|cx, x| {
        let (mut a, b) = (list(cx, 0, 0), cx.list(3));
        push!(cx, a, x[0].lt(x[1]), row, { cx.init(TABLE, row, 0, x[0]) });
        let mut sum = cx.var(c(0.0));
        each!(cx, row in b, {
            let more = cx.get(&sum) + cx.load(TABLE, row, 0);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::RowOfAnotherList);

    // opened again, and changed in its loop
    let good = accepted(|cx, x| {
        let zero = cx.at(0);
        cx.store(COUNTS, zero, 0, c(0.0));
        let mut kept = list(cx, 0, 0);
        push!(cx, kept, x[0].lt(x[1]), row, {
            cx.init(TABLE, row, 0, x[0])
        });
        let again = list(cx, 0, 0);
        each!(cx, row in again, {
            let double = cx.load(TABLE, row, 0) * c(2.0);
            cx.store(TABLE, row, 0, double);
        });
        let mut sum = cx.var(c(0.0));
        each!(cx, row in kept, {
            let more = cx.get(&sum) + cx.load(TABLE, row, 0);
            cx.put(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [6.0]);
    assert_eq!(evaluated(&good, [5.0, 3.0]), [0.0]);
}

#[test]
fn kept_list_and_index_of_a_closed_block_are_refused() {
    let closed = |what, block| Misuse::Closed { what, block };
    let misuse = refused(|cx, x| {
        let mut inner = None;
        when!(cx, x[0].lt(x[1]), { inner = Some(list(cx, 0, 0)) });
        let inner = inner.expect("the recorder runs every block");
        vec![cx.pushed(&inner)]
    });
    assert_eq!(misuse, closed("list", "when!"));
    let misuse = refused(|cx, _| {
        let (first, end) = (cx.at(0), cx.at(2));
        let mut inner = end;
        span!(cx, i in first, end, { inner = cx.index(FIXED, i, 0, 3) });
        vec![cx.number(inner)]
    });
    assert_eq!(misuse, closed("index", "span!"));
    let misuse = refused(|cx, x| {
        let mut kept = list(cx, 0, 0);
        let mut larger = x[0];
        push!(cx, kept, x[0].lt(x[1]), _row, { larger = cx.only(x[1]) });
        vec![larger + x[0]]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "push!" });
    let misuse = refused(|cx, x| {
        let (first, end) = (cx.at(0), cx.at(3));
        span!(cx, i in first, end, {
            let named = cx.index(FIXED, first, 0, 3);
            let (i, named) = (cx.number(i), cx.number(named));
            when!(cx, x[0].lt(i), {
                break_if!(cx, x[0].lt(named));
            });
        });
        vec![]
    });
    assert_eq!(misuse, Misuse::BreakInBlock { block: "when!" });
}

#[test]
fn index_that_changes_from_round_to_round_is_refused() {
    let misuse = refused(|cx, x| {
        let mut sum = cx.var(x[0]);
        let mut row = cx.at(0);
        times!(cx, 3, {
            let more = cx.get(&sum) + cx.constant(FIXED, row, 0);
            cx.set(&mut sum, more);
            row = cx.at(1);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });
    // also one that is known only at run time
    let misuse = refused(|cx, x| {
        let at = cx.at(1);
        let (first, second) = (cx.index(FIXED, at, 0, 3), cx.index(FIXED, at, 1, 3));
        let mut row = first;
        times!(cx, 3, {
            cx.store(TABLE, row, 0, x[0]);
            row = second;
        });
        vec![]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });
    let misuse = refused(|cx, x| {
        let at = cx.at(1);
        let (first, second) = (cx.index(FIXED, at, 0, 3), cx.index(FIXED, at, 1, 3));
        let mut end = first;
        times!(cx, 3, {
            span!(cx, i in at, end, { cx.store(TABLE, i, 0, x[0]) });
            end = second;
        });
        vec![]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });
}

#[test]
fn row_outside_a_table_of_the_model_is_refused() {
    let outside = |row, number| Misuse::OutsideFixed {
        table: FIXED,
        row,
        number,
    };
    type Text = fn(&mut Recorder, &[Recorded]) -> Vec<Recorded>;
    let texts: [(Text, Misuse); 4] = [
        (
            |cx, _| {
                let row = cx.at(3);
                vec![cx.constant(FIXED, row, 0)]
            },
            outside(3, 0),
        ),
        (|cx, x| vec![cx.pick(FIXED, x[0], 2)], outside(0, 2)),
        (
            |cx, _| {
                let (first, end) = (cx.at(0), cx.at(5));
                span!(cx, i in first, end, {
                    let _outside = cx.constant(FIXED, i, 1);
                });
                vec![]
            },
            outside(4, 1),
        ),
        // the rows of a kept list may reach as far as its largest first row and capacity together
        (
            |cx, x| {
                let (at, capacity) = (cx.at(0), cx.at(2));
                let first = cx.index(FIXED, at, 0, 3);
                let mut kept = cx.kept(COUNTS, at, first, capacity);
                push!(cx, kept, x[0].lt(x[1]), row, {
                    cx.init(TABLE, row, 0, x[0])
                });
                vec![]
            },
            Misuse::OutsideTable {
                table: TABLE,
                row: 3,
                number: 0,
            },
        ),
    ];
    for (text, misuse) in texts {
        assert_eq!(refused(text), misuse);
    }
}
