//! Lengths that constraints, springs and sensors are about.

use super::recast::{Recast, recast};

recast! {
    /// A sum of coordinates times coefficients, and the length of a spatial tendon if there is one.
    #[derive(Clone, Debug)]
    pub struct Length<R> {
        /// Coordinates with their coefficients.
        pub terms: Vec<Term<R>>,
        /// Index of the tendon.
        pub tendon: Option<usize>,
    }
}

recast! {
    /// A dof with one coordinate, and a factor.
    #[derive(Clone, Debug)]
    pub struct Term<R> {
        /// The dof.
        pub dof: usize,
        /// [–]
        pub coefficient: R,
    }
}

impl<R> From<Vec<Term<R>>> for Length<R> {
    fn from(terms: Vec<Term<R>>) -> Length<R> {
        Length {
            terms,
            tendon: None,
        }
    }
}
