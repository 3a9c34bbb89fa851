//! Kinematic trees: where bodies are, and their mass matrix.
//!
//! | file | what it computes |
//! |---|---|
//! | `kinematics` | poses of bodies, axes of joints |
//! | `bias` | Coriolis, centrifugal and gravity forces |
//! | `bias_slope` | how these forces change with velocities |
//! | `mass_matrix` | the joint-space inertia matrix |
//! | `inverse_dynamics` | forces of joints from accelerations |
//! | `free_joints` | armature and damping of free joints |
//! | `generalized` | `qpos`, `qvel` and forces in MuJoCo's conventions |

pub mod bias;
pub(in crate::step) mod bias_slope;
pub mod free_joints;
pub mod generalized;
pub mod inverse_dynamics;
pub mod kinematics;
pub mod mass_matrix;
