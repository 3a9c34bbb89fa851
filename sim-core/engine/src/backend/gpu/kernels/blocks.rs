//! Lists the pairs of shapes by blocks, for GPUs: the bounding spheres of a block are tested together.
//!
//! A thread of a GPU waits some hundred cycles for what it loads, and a pair takes three loads that need one another.

use sim_physics::constants::Constants;
use sim_physics::constants::pair_groups::BLOCK;
use sim_physics::lane::Fixed;
use std::borrow::Cow;

/// The constants with blocks, where some group has enough pairs.
pub(in crate::backend::gpu) fn with_blocks(m: Cow<'_, Constants<f64>>) -> Cow<'_, Constants<f64>> {
    if m.contacts.groups.iter().all(|group| group.blocks() == 0) {
        return m;
    }
    let mut m = m.into_owned();
    let t = &mut m.contacts;
    let base = t.tables.indices.len();
    for group in t.groups.iter().filter(|group| group.blocks() > 0) {
        for first in (group.first..group.end).step_by(BLOCK) {
            let end = (first + BLOCK).min(group.end);
            let pairs = (first..first + BLOCK).map(|pair| pair.min(end - 1));
            let row = pairs.chain([end]).map(|index| index as u32);
            t.tables.indices.extend(row);
        }
    }
    let stride = BLOCK + 1;
    let rows = (t.tables.indices.len() - base) / stride;
    t.handles.pair_blocks = Fixed { base, stride, rows };
    Cow::Owned(m)
}
