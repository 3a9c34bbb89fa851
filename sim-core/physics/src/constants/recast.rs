//! The same constants in another precision: scalars are rounded, everything else is copied.

use crate::lane::{Real, Tables};

/// A type with scalars of one precision that converts to another precision.
pub trait Recast<S> {
    /// The type with scalars of precision `S`.
    type Out;
    /// The same, rounded.
    fn recast(&self) -> Self::Out;
}

macro_rules! scalar {
    ($($real:ident)*) => {
        $(impl<S: Real> Recast<S> for $real {
            type Out = S;
            fn recast(&self) -> S {
                S::from_f64(self.to_f64())
            }
        })*
    };
}
scalar! { f32 f64 }

impl<S, T: Recast<S>> Recast<S> for Vec<T> {
    type Out = Vec<T::Out>;
    fn recast(&self) -> Self::Out {
        self.iter().map(T::recast).collect()
    }
}

impl<S, T: Recast<S>> Recast<S> for Option<T> {
    type Out = Option<T::Out>;
    fn recast(&self) -> Self::Out {
        self.as_ref().map(T::recast)
    }
}

impl<S, T: Recast<S>, const N: usize> Recast<S> for [T; N] {
    type Out = [T::Out; N];
    fn recast(&self) -> Self::Out {
        self.each_ref().map(T::recast)
    }
}

impl<S, T: Clone, U: Clone> Recast<S> for (T, U) {
    type Out = (T, U);
    fn recast(&self) -> Self::Out {
        self.clone()
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for Tables<R> {
    type Out = Tables<S>;
    fn recast(&self) -> Tables<S> {
        Tables {
            numbers: Recast::<S>::recast(&self.numbers),
            indices: self.indices.clone(),
        }
    }
}

/// Implements [`Recast`] for types without scalars of the run's precision.
macro_rules! same {
    ($($name:ty),* $(,)?) => {
        $(impl<S> Recast<S> for $name {
            type Out = $name;
            fn recast(&self) -> $name {
                self.clone()
            }
        })*
    };
}
pub(super) use same;

same! { usize, bool, u32 }

/// Defines structs that are generic over the precision `R`, and implements [`Recast`] for them, field by field.
macro_rules! recast {
    ($($(#[$meta:meta])* pub struct $name:ident<R> { $($(#[$field_meta:meta])* pub $field:ident: $type:ty,)* })*) => {
        $(
            $(#[$meta])*
            pub struct $name<R> {
                $($(#[$field_meta])* pub $field: $type,)*
            }

            impl<S: $crate::lane::Real, R: $crate::lane::Real + Recast<S, Out = S>> Recast<S> for $name<R> {
                type Out = $name<S>;
                fn recast(&self) -> $name<S> {
                    $name {
                        $($field: <$type as Recast<S>>::recast(&self.$field),)*
                    }
                }
            }
        )*
    };
}
pub(super) use recast;
