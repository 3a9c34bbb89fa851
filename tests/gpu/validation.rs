//! Vulkan's validation layer has nothing to say about worlds on a GPU.

#[path = "../../sim-core/device/tests/device/layer.rs"]
mod layer;

use layer::{messages, under_the_layer};

/// Tests that between them step, evaluate every field, reset, write, keep and restore, import a reader's memory, freeze worlds and touch. The
/// others do the same to other models, and take minutes.
const TESTS: [&str; 7] = [
    "agreement::all_fields_of_the_grasp_are_those_of_the_cpu",
    "books::a_cube_on_a_table_stays_there",
    "books::a_run_resumes_from_a_snapshot_bit_for_bit_and_takes_the_cpus",
    "books::parameters_are_written_read_and_reach_the_next_step",
    "books::starts_that_are_drawn_resets_with_masks_and_seeds_and_writes_are_the_cpus",
    "books::worlds_that_are_lost_are_frozen_or_reset_as_on_the_cpu",
    "delivery::what_the_device_writes_is_read_through_another_mapping_and_nothing_is_copied",
];

#[test]
fn the_validation_layer_is_silent_over_worlds_on_a_gpu() {
    let arguments: Vec<&str> = ["--exact"].into_iter().chain(TESTS).collect();
    let printed = under_the_layer("worlds", &arguments);
    assert_eq!(printed.matches(" ... ok").count(), TESTS.len(), "{printed}");
    assert!(messages(&printed).is_empty(), "{printed}");
}
