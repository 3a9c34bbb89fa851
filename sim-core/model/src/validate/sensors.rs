//! Checks of sites, contact sensors and delays of commands.

use super::shape::pose;
use crate::description::{Description, named};
use crate::error::ModelError;
use crate::pose::Pose;
use crate::value_checks::{count, in_range, name, positive, unique};

/// Largest delay of commands [control frames].
const DELAY_FRAMES_MAX: usize = 1000;
/// Most controls that an actuator keeps: each step moves all of them.
const KEPT_CONTROLS_MAX: usize = 256;
/// Most rays of a height scan along an axis.
const SCAN_MAX: usize = 1000;
/// Least and most damping of an inverse Jacobian [m and rad alike]: its square stays within `f32`, and so does what it is added to.
const DAMPING: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

impl Description {
    pub(super) fn validate_sensors(&self) -> Result<(), ModelError> {
        let sites = self.sites.iter().map(|site| site.name.as_str());
        unique("scene", "site", sites).map_err(|(_, error)| error)?;
        for site in &self.sites {
            name("site", &site.name)?;
            let what = format!("site `{}`", site.name);
            pose(&what, &site.pose)?;
            self.bearer(&what, site.body.as_deref())?;
            self.frame(&what, site.relative_to.as_deref())?;
            in_range(
                &format!("{what}: damping"),
                site.damping,
                DAMPING.contains(&site.damping),
                "it must be between 1e-6 and 1e6",
            )?;
        }
        let scans = self.height_scans.iter().map(|scan| scan.name.as_str());
        unique("scene", "height scan", scans).map_err(|(_, error)| error)?;
        for scan in &self.height_scans {
            name("height scan", &scan.name)?;
            let what = format!("height scan `{}`", scan.name);
            pose(&what, &Pose::at(scan.pos))?;
            self.bearer(&what, scan.body.as_deref())?;
            for rays in scan.counts {
                let rule = "it must be between 1 and 1000 rays along each axis";
                count(&format!("{what}: shape"), rays, SCAN_MAX, rule)?;
            }
            for value in scan.spacing.into_iter().chain([scan.reach]) {
                positive(&format!("{what}: spacing or reach"), value)?;
            }
        }
        let sensors = self.contact_sensors.iter();
        let names = sensors.clone().map(|sensor| sensor.name.as_str());
        unique("scene", "contact sensor", names).map_err(|(_, error)| error)?;
        let shapes = self.shape_names();
        for sensor in sensors {
            name("contact sensor", &sensor.name)?;
            let what = format!("contact sensor `{}`", sensor.name);
            named(&what, &sensor.of, &shapes)?;
            if let Some(against) = &sensor.against {
                named(&what, against, &shapes)?;
            }
        }
        if let Some(most) = self.command_delay_max {
            let rule = "it must be between 1 and 1000 control frames of substeps";
            count(
                "command_delay_max",
                most,
                DELAY_FRAMES_MAX * self.substeps,
                rule,
            )?;
        }
        self.validate_actuator_delays()
    }

    /// Refuses delays of actuators that are many steps long.
    fn validate_actuator_delays(&self) -> Result<(), ModelError> {
        for robot in &self.robots {
            let parts = robot.precompiled.iter();
            for actuator in parts.flat_map(|parts| &parts.actuators) {
                let Some(delay) = &actuator.delay else {
                    continue;
                };
                let (robot, actuator) = (&robot.name, &actuator.name);
                let what =
                    format!("robot `{robot}`: actuator `{actuator}`: number of steps of its delay");
                let steps = (delay.seconds / self.dt).ceil().max(1.0);
                let rule = "give at most 256, with a shorter delay or a longer time step";
                // the oldest control that is kept stands for those before it
                let is_short = (steps as usize).min(delay.samples) <= KEPT_CONTROLS_MAX;
                in_range(&what, steps, is_short, rule)?;
            }
        }
        Ok(())
    }
}
