//! Rows of constraints: what they measure, how soft they are, and what they are driven to.
//!
//! | file | rows |
//! |---|---|
//! | `joint_rows` | mimic joints, dry friction, limits |
//! | `ties`, `tied_frames` | equalities and limits of several joints or of frames |
//! | `contact_rows` | contacts: Jacobian, impedance, friction |
//! | `contact_surfaces` | contacts whose surfaces move beside their bodies, and that adhere |
//! | `swing` | what J q̈ of free bodies has beside MuJoCo's |

pub mod contact_rows;
mod contact_surfaces;
pub mod joint_rows;
mod swing;
pub mod tied_frames;
pub mod ties;
