//! Refused: rows, breaks, variables and tables out of place. Each beside a good twin.

use crate::{TABLE, accepted, c, evaluated, refused};
use sim_physics::lane::{Cx, Num, Table};
use sim_physics::{break_if, each, push, times, when};
use sim_record::{MAX_NESTING, Misuse, Recorded, Recorder};

#[test]
fn row_used_under_another_list_is_refused() {
    // filled in the block of another list
    let misuse = refused(|cx, x| {
        let (mut a, mut b) = (cx.list(3), cx.list(3));
        push!(cx, a, x[0].lt(x[1]), row_a, {
            push!(cx, b, x[1].lt(c(2.0)), _row_b, {
                cx.init(TABLE, row_a, 0, x[0]);
            });
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::RowOfAnotherList);
    // read in a loop over another list
    let other = Table { base: 6, ..TABLE };
    let misuse = refused(|cx, x| {
        let (mut a, mut b) = (cx.list(3), cx.list(3));
        push!(cx, a, x[0].lt(x[1]), row, { cx.init(TABLE, row, 0, x[0]) });
        push!(cx, b, x[1].lt(x[0]), row, { cx.init(other, row, 0, x[1]) });
        let mut sum = cx.var(c(0.0));
        each!(cx, row in a, {
            let more = cx.get(&sum) + cx.load(other, row, 0);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::RowOfAnotherList);

    let good = accepted(|cx, x| {
        let (mut a, mut b) = (cx.list(3), cx.list(3));
        push!(cx, a, x[0].lt(x[1]), row_a, {
            cx.init(TABLE, row_a, 0, x[0]);
            when!(cx, c(0.0).lt(x[0]), { cx.init(TABLE, row_a, 1, x[0]) });
            push!(cx, b, x[1].lt(c(5.0)), row_b, {
                cx.init(other, row_b, 0, x[1])
            });
        });
        let mut sum = cx.var(c(0.0));
        each!(cx, row_a in a, {
            each!(cx, row_b in b, {
                let more = cx.load(TABLE, row_a, 0) * cx.load(other, row_b, 0);
                let more = cx.get(&sum) + more;
                cx.set(&mut sum, more);
            });
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [3.0, 4.0]), [12.0]);
    assert_eq!(evaluated(&good, [4.0, 3.0]), [0.0]);
}

#[test]
fn row_used_after_its_push_is_refused() {
    let misuse = refused(|cx, x| {
        let mut list = cx.list(3);
        let mut kept = None;
        push!(cx, list, x[0].lt(x[1]), row, { kept = Some(row) });
        cx.init(TABLE, kept.expect("the recorder runs every block"), 0, x[0]);
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::RowAfterBlock);

    accepted(|cx, x| {
        let mut list = cx.list(3);
        push!(cx, list, x[0].lt(x[1]), row, {
            let kept = row;
            cx.init(TABLE, kept, 0, x[0]);
        });
        vec![x[0]]
    });
}

#[test]
fn break_inside_a_block_is_refused() {
    let misuse = refused(|cx, x| {
        times!(cx, 3, {
            when!(cx, x[0].lt(x[1]), {
                break_if!(cx, x[0].lt(c(0.0)));
            });
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::BreakInBlock { block: "when!" });
    let misuse = refused(|cx, x| {
        let mut list = cx.list(3);
        times!(cx, 3, {
            push!(cx, list, x[0].lt(x[1]), _row, {
                break_if!(cx, x[0].lt(c(0.0)));
            });
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::BreakInBlock { block: "push!" });

    let good = accepted(|cx, x| {
        let mut rounds = cx.var(c(0.0));
        times!(cx, 3, {
            let mut stop = cx.var(c(0.0));
            when!(cx, x[0].lt(x[1]), {
                let reached = c(1.5).lt(cx.get(&rounds));
                cx.set(&mut stop, Num::select(reached, c(1.0), c(0.0)));
            });
            break_if!(cx, c(0.5).lt(cx.get(&stop)));
            let more = cx.get(&rounds) + c(1.0);
            cx.set(&mut rounds, more);
        });
        vec![cx.get(&rounds)]
    });
    assert_eq!(evaluated(&good, [1.0, 2.0]), [2.0]);
    assert_eq!(evaluated(&good, [2.0, 1.0]), [3.0]);
}

#[test]
fn variable_list_and_index_of_a_closed_block_are_refused() {
    let misuse = refused(|cx, x| {
        let mut kept = None;
        when!(cx, x[0].lt(x[1]), { kept = Some(cx.var(x[0])) });
        vec![cx.get(&kept.expect("the recorder runs every block"))]
    });
    assert_eq!(
        misuse,
        Misuse::Closed {
            what: "variable",
            block: "when!"
        }
    );
    let misuse = refused(|cx, x| {
        let mut kept = None;
        times!(cx, 2, { kept = Some(cx.list(2)) });
        let list = kept.expect("the recorder runs every body");
        vec![x[0] + cx.pushed(&list)]
    });
    assert_eq!(
        misuse,
        Misuse::Closed {
            what: "list",
            block: "times!"
        }
    );
    let misuse = refused(|cx, x| {
        let mut kept = None;
        let mut rounds = cx.times(2);
        while let Some(i) = cx.next(&mut rounds) {
            kept = Some(i);
        }
        vec![x[0] + cx.load(TABLE, kept.expect("the recorder runs every body"), 0)]
    });
    assert_eq!(
        misuse,
        Misuse::Closed {
            what: "index",
            block: "times!"
        }
    );

    // each iteration may have variables and lists of its own
    let good = accepted(|cx, x| {
        let mut sum = cx.var(c(0.0));
        times!(cx, 2, {
            let mut list = cx.list(2);
            push!(cx, list, x[0].lt(x[1]), row, {
                cx.init(TABLE, row, 0, x[1])
            });
            let mut inner = cx.var(c(1.0));
            each!(cx, row in list, {
                let more = cx.get(&inner) + cx.load(TABLE, row, 0);
                cx.set(&mut inner, more);
            });
            let more = cx.get(&sum) + cx.get(&inner);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [12.0]);
    assert_eq!(evaluated(&good, [5.0, 3.0]), [2.0]);
}

/// Loops inside one another, counting the iterations of the innermost.
fn nested<C: Cx>(cx: &mut C, count: &mut C::V, depth: usize) {
    if depth == 0 {
        let more = cx.get(count) + C::F::c(1.0);
        return cx.set(count, more);
    }
    times!(cx, 2, { nested(cx, count, depth - 1) });
}

#[test]
fn loops_deeper_than_the_limit_are_refused() {
    let text = |depth| {
        move |cx: &mut Recorder, x: &[Recorded]| {
            let mut count = cx.var(x[0]);
            nested(cx, &mut count, depth);
            vec![cx.get(&count)]
        }
    };
    assert_eq!(refused(text(MAX_NESTING + 1)), Misuse::TooDeep);
    let good = accepted(text(MAX_NESTING));
    assert_eq!(
        evaluated(&good, [0.0, 0.0]),
        [2.0_f32.powi(MAX_NESTING as i32)]
    );
}

#[test]
fn number_outside_its_table_is_refused() {
    let at = |row, number| Misuse::OutsideTable {
        table: TABLE,
        row,
        number,
    };
    let misuse = refused(|cx, _| {
        let row = cx.at(3);
        vec![cx.load(TABLE, row, 1)]
    });
    assert_eq!(misuse, at(3, 1));
    let misuse = refused(|cx, x| {
        let row = cx.at(2);
        cx.store(TABLE, row, 2, x[0]);
        vec![]
    });
    assert_eq!(misuse, at(2, 2));
    let misuse = refused(|cx, x| {
        let mut list = cx.list(4);
        push!(cx, list, x[0].lt(x[1]), row, {
            cx.init(TABLE, row, 0, x[0])
        });
        vec![]
    });
    assert_eq!(misuse, at(3, 0));

    let good = accepted(|cx, x| {
        let row = cx.at(2);
        cx.store(TABLE, row, 1, x[0]);
        vec![cx.load(TABLE, row, 1)]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [3.0]);
    assert_eq!(good.scratch(), 6);
}
