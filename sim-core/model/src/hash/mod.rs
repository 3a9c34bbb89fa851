//! The hash of a model: FNV-1a of a text of all that a run depends on.
//!
//! Recordings and snapshots store it, and run on no model with another one. So the text is a format: these files write its
//! names, keys and their order, and say nothing by what the code calls a type or a field. A rename here is never needed and
//! breaks every recording; `tests/model/hash.rs` and the recordings in `tests/data/recorded` show it.

mod additions;
mod constants;
mod contacts;
mod sensors;
mod start;
mod text;

use crate::model::Model;
use text::{Text, View};

impl Model {
    /// Computes the hash.
    pub(crate) fn own_hash(&self) -> u64 {
        let mut text = Text::new();
        self.constants.write(&mut text);
        // Display writes 1 where the text of other scalars has 1.0
        text.put(&format!(" {} {}", self.dt, self.substeps));
        let parts: [&dyn View; 6] = [
            &self.dof_names,
            &self.body_names,
            &self.start,
            &self.shape_names,
            &self.site_names,
            &self.contact_sensors,
        ];
        for part in parts {
            text.put(" ");
            part.write(&mut text);
        }
        text.put(&format!(" {}", self.command_delay_max));
        text.hash()
    }
}
