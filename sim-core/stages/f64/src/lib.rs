//! Double precision, the reference.

sim_physics::compiled!(f64, "avx2,fma,bmi1,bmi2");
