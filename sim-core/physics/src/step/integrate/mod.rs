//! The next state: `semi_implicit` steps, or `runge_kutta` of fourth order.

pub mod runge_kutta;
pub mod semi_implicit;
