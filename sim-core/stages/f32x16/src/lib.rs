//! Single precision, sixteen worlds a register: AVX-512, as on Skylake-X, Zen 4 and later.

#![cfg(target_arch = "x86_64")]

sim_physics::compiled!(
    sim_physics::lane::simd::F32x16,
    "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2"
);
