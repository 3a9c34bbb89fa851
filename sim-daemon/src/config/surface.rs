//! What a shape or robot of a scene file says of surfaces.

use sim_model::Surface;

use super::number::Number;

/// What is given of a surface; what is left out stays as it is.
pub(super) struct Given {
    pub(super) mu: Option<Number>,
    pub(super) ke: Option<Number>,
    pub(super) kd: Option<Number>,
    pub(super) kf: Option<Number>,
    pub(super) margin: Option<Number>,
    pub(super) gap: Option<Number>,
    pub(super) condim: Option<usize>,
    pub(super) group: Option<i32>,
}

/// What a table gives of a surface. Tables hold its entries one by one: serde cannot name unknown ones beside a flattened
/// struct.
macro_rules! given {
    ($table:expr) => {
        $crate::config::surface::Given {
            mu: $table.mu,
            ke: $table.ke,
            kd: $table.kd,
            kf: $table.kf,
            margin: $table.margin,
            gap: $table.gap,
            condim: $table.condim,
            group: $table.group,
        }
    };
}
pub(super) use given;

impl Given {
    /// Writes it over a surface.
    pub(super) fn write(&self, surface: &mut Surface) {
        let numbers = [
            (self.mu, &mut surface.mu),
            (self.ke, &mut surface.ke),
            (self.kd, &mut surface.kd),
            (self.kf, &mut surface.kf),
            (self.margin, &mut surface.margin),
            (self.gap, &mut surface.gap),
        ];
        for (given, value) in numbers {
            *value = given.map_or(*value, |given| given.0);
        }
        surface.condim = self.condim.unwrap_or(surface.condim);
        surface.group = self.group.unwrap_or(surface.group);
    }
}
