//! Clocks among the sensors of MuJoCo models: the time since a world's reset, which only backends know.

use sim_physics::constants::Constants;
use sim_physics::constants::sensors::SensorKind;
use sim_physics::lane::Real;

/// Whether there are any.
pub(super) fn are_in<R: Real>(m: &Constants<R>) -> bool {
    let sensors = m.sensors.all.iter();
    sensors
        .clone()
        .any(|sensor| matches!(sensor.kind, SensorKind::Clock))
}

/// Writes the clocks of a world at this time [s] to its row of `sensordata`.
pub(super) fn put<R: Real>(m: &Constants<R>, time: f64, row: &mut [R]) {
    for sensor in &m.sensors.all {
        if let SensorKind::Clock = sensor.kind {
            let most = sensor.cutoff.as_ref().map(|cutoff| cutoff.most.to_f64());
            row[sensor.first] = R::from_f64(time.min(most.unwrap_or(f64::INFINITY)));
        }
    }
}
