//! The next state: `semi_implicit` steps, `implicit` ones, or `runge_kutta` of fourth order.

pub mod implicit;
pub mod runge_kutta;
pub mod semi_implicit;
