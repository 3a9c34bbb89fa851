//! Single precision, one world at a time.

sim_core::compiled!(f32, "avx2,fma,bmi1,bmi2");
