//! Refused: values that leave their block, iterations that differ, constants. Each beside a good twin.

use crate::{TABLE, accepted, c, evaluated, refused};
use sim_physics::lane::{Cx, Num};
use sim_physics::{break_if, each, push, times, when};
use sim_record::{Misuse, Recorded, Recorder, record};

#[test]
fn value_that_leaves_a_loop_is_refused() {
    let misuse = refused(|cx, x| {
        let mut last = x[0];
        times!(cx, 3, {
            last = x[0] * x[1];
        });
        vec![last + x[0]]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "times!" });
    // also where the same value was known before the loop, and where it is a constant
    let misuse = refused(|cx, x| {
        let mut last = x[0] * x[1];
        times!(cx, 3, {
            last = x[0] * x[1];
        });
        vec![last]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "times!" });
    let misuse = refused(|cx, x| {
        let mut last = x[0];
        let list = cx.list(2);
        each!(cx, _row in list, {
            last = c(1.0);
        });
        vec![last]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "each!" });

    let good = accepted(|cx, x| {
        let mut last = cx.var(x[0]);
        times!(cx, 3, {
            let product = cx.get(&last) * x[1];
            cx.set(&mut last, product);
        });
        vec![cx.get(&last) + x[0]]
    });
    assert_eq!(evaluated(&good, [3.0, 2.0]), [27.0]);
}

#[test]
fn value_used_only_in_the_next_round_is_refused() {
    let misuse = refused(|cx, x| {
        let mut sum = cx.var(c(0.0));
        let mut previous = x[0];
        times!(cx, 3, {
            let next = cx.get(&sum) + previous;
            cx.set(&mut sum, next);
            previous = next * x[1];
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::NextIteration { block: "times!" });

    let good = accepted(|cx, x| {
        let mut sum = cx.var(c(0.0));
        let mut previous = cx.var(x[0]);
        times!(cx, 3, {
            let next = cx.get(&sum) + cx.get(&previous);
            cx.set(&mut sum, next);
            cx.set(&mut previous, next * x[1]);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [1.0, 2.0]), [9.0]);
}

#[test]
fn value_that_leaves_a_block_is_refused() {
    let misuse = refused(|cx, x| {
        let mut larger = x[0];
        when!(cx, x[0].lt(x[1]), {
            larger = x[1] + c(1.0);
        });
        vec![larger]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "when!" });
    let misuse = refused(|cx, x| {
        let mut larger = x[0];
        let mut list = cx.list(3);
        push!(cx, list, x[0].lt(x[1]), _row, {
            larger = x[1] + c(1.0);
        });
        vec![larger]
    });
    assert_eq!(misuse, Misuse::ValueLeaves { block: "push!" });

    let good = accepted(|cx, x| {
        let mut larger = cx.var(x[0]);
        when!(cx, x[0].lt(x[1]), {
            cx.set(&mut larger, x[1] + c(1.0));
        });
        vec![cx.get(&larger)]
    });
    assert_eq!(evaluated(&good, [1.0, 2.0]), [3.0]);
    assert_eq!(evaluated(&good, [2.0, 1.0]), [2.0]);
}

#[test]
fn loop_left_by_a_native_break_is_refused() {
    let misuse = refused(|cx, x| {
        let mut n = 0;
        times!(cx, 3, {
            n += 1;
            if n == 2 {
                break;
            }
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::LeftOpen { block: "times!" });
    // and where it leaves a block inside the loop
    let misuse = refused(|cx, x| {
        let mut n = 0;
        times!(cx, 3, {
            when!(cx, x[0].lt(x[1]), {
                n += 1;
                if n > 0 {
                    continue;
                }
            });
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::LeftOpen { block: "when!" });

    let good = accepted(|cx, x| {
        let mut n = cx.var(c(0.0));
        times!(cx, 3, {
            break_if!(cx, c(1.5).lt(cx.get(&n)));
            let more = cx.get(&n) + x[0];
            cx.set(&mut n, more);
        });
        vec![cx.get(&n)]
    });
    assert_eq!(evaluated(&good, [1.0, 0.0]), [2.0]);
}

#[test]
fn block_left_by_return_is_refused() {
    fn inner(cx: &mut Recorder, x: &[Recorded]) -> Vec<Recorded> {
        let (block, any) = cx.enter(x[0].lt(x[1]));
        if any {
            return vec![x[0]];
        }
        cx.leave(block);
        vec![x[1]]
    }
    assert_eq!(refused(inner), Misuse::LeftOpen { block: "when!" });
}

#[test]
fn constant_that_changes_per_round_is_refused() {
    let misuse = refused(|cx, x| {
        let mut sum = cx.var(x[0]);
        let mut round = 0;
        times!(cx, 3, {
            round += 1;
            let more = cx.get(&sum) + c(f64::from(round) * 0.5);
            cx.set(&mut sum, more);
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(
        misuse,
        Misuse::ConstantChanges {
            block: "times!",
            first: 0.5,
            second: 1.0
        }
    );

    let good = accepted(|cx, x| {
        let mut sum = cx.var(x[0]);
        let mut step = cx.var(c(0.5));
        times!(cx, 3, {
            let step_now = cx.get(&step);
            let more = cx.get(&sum) + step_now;
            cx.set(&mut sum, more);
            cx.set(&mut step, step_now + c(0.5));
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [1.0, 0.0]), [4.0]);
}

#[test]
fn iterations_that_differ_are_refused() {
    // an older value that changes
    let misuse = refused(|cx, x| {
        let mut sum = cx.var(c(0.0));
        let mut which = x[0];
        times!(cx, 3, {
            let more = cx.get(&sum) + which;
            cx.set(&mut sum, more);
            which = x[1];
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });
    // a native branch that changes
    let misuse = refused(|cx, x| {
        let mut sum = cx.var(c(0.0));
        let mut first = true;
        times!(cx, 3, {
            if first {
                cx.set(&mut sum, x[0]);
            }
            first = false;
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });
    // an index that changes
    let misuse = refused(|cx, x| {
        let mut row = cx.at(0);
        times!(cx, 3, {
            let next = cx.load(TABLE, row, 0);
            cx.store(TABLE, row, 1, next + x[0]);
            row = cx.at(1);
        });
        vec![x[0]]
    });
    assert_eq!(misuse, Misuse::IterationsDiffer { block: "times!" });

    // native branches and loops on constants of the model are the same in every iteration
    let good = accepted(|cx, x| {
        let mut sum = cx.var(c(0.0));
        times!(cx, 3, {
            for (k, x) in x.iter().enumerate() {
                if k != 1 {
                    let more = cx.get(&sum) + *x;
                    cx.set(&mut sum, more);
                }
            }
        });
        vec![cx.get(&sum)]
    });
    assert_eq!(evaluated(&good, [2.0, 100.0]), [6.0]);
}

#[test]
fn constant_that_is_not_a_number_is_refused() {
    let misuse = refused(|_, x| vec![x[0] + c(0.0).div(c(0.0))]);
    assert_eq!(misuse, Misuse::NotANumber);
    assert_eq!(refused(|_, _| vec![c(-1.0).sqrt()]), Misuse::NotANumber);
    // nothing depends on it
    let good = accepted(|_, x| {
        let _unused = x[1] + c(0.0).div(c(0.0));
        vec![x[0]]
    });
    assert_eq!(evaluated(&good, [3.0, 5.0]), [3.0]);
}

#[test]
fn value_of_another_recording_is_refused() {
    let mut kept = None;
    accepted(|_, x| {
        kept = Some(x[0] * x[1]);
        vec![]
    });
    let kept = kept.expect("the text was recorded");
    assert_eq!(
        refused(|_, x| vec![x[0] + kept]),
        Misuse::OtherRecording { what: "value" }
    );

    let before = c(2.0);
    let good = accepted(|_, x| vec![x[0] * before]);
    assert_eq!(evaluated(&good, [3.0, 5.0]), [6.0]);
}

#[test]
fn recording_goes_on_after_a_text_that_panicked() {
    let panicked = std::panic::catch_unwind(|| {
        record(1, |_, _| std::panic::resume_unwind(Box::new("on purpose")))
    });
    assert!(panicked.is_err());
    let good = accepted(|_, x| vec![x[0] + x[1]]);
    assert_eq!(evaluated(&good, [3.0, 5.0]), [8.0]);
}

#[test]
fn errors_name_the_line_of_the_text_and_the_cure() {
    let line = line!() + 4;
    let error = record(1, |cx, x| {
        let mut last = x[0];
        times!(cx, 3, { last = x[0] * x[0] });
        vec![last + x[0]]
    })
    .expect_err("a value leaves the loop");
    let message = error.to_string();
    assert_eq!(error.line, line);
    assert!(
        message.contains("refusals.rs:") && message.contains("`cx.var` before"),
        "{message}"
    );
}
