//! Whose files those of a configuration are, and files whose pages are taken later.

use crate::iceoryx2::config::Config;
use crate::world::{is_on, me, with};

/// Makes ports whose memory the reader takes, before anything is sent.
pub fn reserved_by_reader<T>(make: impl FnOnce() -> T) -> T {
    let set = |reserves| {
        if is_on() {
            with(|world| match reserves {
                true => world.wires.reserving.insert(me()),
                false => world.wires.reserving.remove(&me()),
            });
        }
    };
    set(true);
    let made = make();
    set(false);
    made
}

/// Whether another program has cut a file of a run while it was mapped here.
pub fn is_damaged(config: &Config) -> bool {
    super::mapping::is_damaged(run_of(config))
}

/// The number of a run of a daemon.
pub fn run_of(config: &Config) -> u64 {
    let (folder, prefix) = (config.global.root_path(), config.global.prefix);
    crate::iceoryx2::hash(&[
        folder.to_string().trim_end_matches('/'),
        &prefix.to_string(),
    ])
}
