//! A control frame takes no memory.

mod common;

use common::shapes::shapes;
use common::{Demo, Run, command, lesson_with_table};
use sim_engine::backend::Values;
use sim_engine::simulation::{Options, Precision};
use sim_model::{Cone, Distribution, Pose, Site};
use sim_physics::arrays::Field;
use sim_physics::constants::params::Param;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts what the thread of a test takes; other threads of the harness do as they please.
struct Counting;

thread_local! {
    static TAKEN: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: all work is the system's allocator's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.with(|taken| taken.set(taken.get() + 1));
        // SAFETY: by the caller's contract.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: by the caller's contract.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn taken(work: impl FnOnce()) -> usize {
    let before = TAKEN.with(Cell::get);
    work();
    TAKEN.with(Cell::get) - before
}

/// Commands that come late and with noise, and a noisy sensor.
const NOISY: [Param; 3] = [Param::CommandDelay, Param::JointFNoise, Param::SiteQNoise];

#[test]
fn command_step_and_forward_take_no_memory() {
    assert!(taken(|| drop(vec![1u8])) == 1, "the count works");
    let mut lesson = lesson_with_table(Demo::Target, true);
    lesson.params.extend(NOISY);
    lesson.sites.push(Site {
        name: "tip".to_owned(),
        body: Some("cube".to_owned()),
        pose: Pose::identity(),
        relative_to: None,
        damping: Site::DAMPING,
    });
    let lesson = lesson.compile().unwrap();
    let (_, row) = command(Demo::Target, 20);
    let shapes = shapes(Cone::Elliptic).compile().unwrap();
    // without contacts, where this processor has machine code
    let alone = common::lesson(Demo::Torque).compile().unwrap();
    for (model, field, row, touches) in [
        (lesson, Field::JointTargetQ, &row[..], true),
        (shapes, Field::JointF, &[0.5; 12], true),
        (alone, Field::JointF, &[0.5; 9], false),
    ] {
        for precision in [Precision::F32, Precision::F64] {
            let options = Options {
                worlds: 100,
                precision,
                threads: Some(1),
                fields: Field::ALL.to_vec(),
                ..Options::default()
            };
            let mut run = Run::new(&model, options);
            for param in model.constants().varying.params() {
                let columns = param.columns(&model.sizes());
                let ones = vec![1e-3; 100 * columns];
                run.sim
                    .write_param(param, 0..columns, Values::F64(&ones), None)
                    .unwrap();
            }
            let values: Vec<f64> = (0..100).flat_map(|_| row.iter().copied()).collect();
            let count = taken(|| {
                for _ in 0..3 {
                    run.sim
                        .command(field, 0..row.len(), Values::F64(&values))
                        .unwrap();
                    run.step();
                    run.forward();
                }
            });
            assert_eq!(count, 0, "{precision:?}");
            let contacts = run.get(Field::ContactCount, 0)[0];
            assert_eq!(contacts > 0.0, touches, "{contacts} contacts");
        }
    }
}

#[test]
fn a_reset_takes_no_memory_even_where_it_draws() {
    let mut scene = lesson_with_table(Demo::Target, true);
    let offset = Distribution::Normal {
        mean: 0.0,
        std: 0.1,
    };
    for robot in &mut scene.robots {
        for joint in robot.joints.iter_mut().filter(|j| j.mimic.is_none()) {
            for dof in &mut joint.dofs {
                (dof.offset_q, dof.offset_qd) = (Some(offset), Some(offset));
            }
        }
    }
    let mut run = Run::new(&scene.compile().unwrap(), Options::default());
    let count = taken(|| {
        run.sim.reset(None, None).unwrap();
        run.sim.reset(Some(&[true]), Some(&[1])).unwrap();
    });
    assert_eq!(count, 0);
}
