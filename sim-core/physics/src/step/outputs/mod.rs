//! Outputs of a state, which no step needs.
//!
//! | file | field |
//! |---|---|
//! | `poses`, `velocities` | `body_q`, `body_qd` of links |
//! | `sites`, `site_inverse` | frames of interest, their Jacobians and IMUs |
//! | `height_scan` | heights around a link |
//! | `energy` | kinetic and potential energy |
//! | `frames` | frames of bodies, sites and geoms of MuJoCo models |
//! | `tendons` | lengths of tendons of MuJoCo models |
//! | `subtrees`, `inertias`, `momenta`, `wrenches` | what MuJoCo computes of bodies and their subtrees |
//! | `sensors` | `sensordata` |

pub mod energy;
pub mod frames;
pub mod height_scan;
pub mod inertias;
pub mod momenta;
pub mod poses;
pub mod sensors;
pub mod site_inverse;
pub mod sites;
pub mod subtrees;
pub mod tendons;
pub mod velocities;
pub mod wrenches;
