//! Single precision, eight worlds a register: AVX2 and fused multiply-add, as on Haswell, Zen and later.

#![cfg(target_arch = "x86_64")]

sim_physics::compiled!(sim_physics::lane::simd::F32x8, "avx2,fma,bmi1,bmi2");
