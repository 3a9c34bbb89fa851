//! Single precision, eight worlds a block: AVX2 with fused multiply-add as on Haswell, Zen and later, or NEON.

#![cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]

sim_physics::compiled!(sim_physics::lane::simd::F32x8, "avx2,fma,bmi1,bmi2");
