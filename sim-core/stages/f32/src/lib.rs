//! Single precision, one world at a time.

sim_physics::compiled!(f32, "avx2,fma,bmi1,bmi2");
