//! Numbers of a scene: finite or not, alone or one per dof.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::SeqAccessDeserializer;
use serde::de::{Deserializer, Error, IntoDeserializer, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// An f64 that also crosses by JSON when it is not finite, as the string `"inf"`, `"-inf"` or `"nan"`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Number(pub f64);

impl From<f64> for Number {
    fn from(value: f64) -> Number {
        Number(value)
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_finite() {
            serializer.serialize_f64(self.0)
        } else if self.0.is_nan() {
            serializer.serialize_str("nan")
        } else {
            serializer.serialize_str(if self.0 > 0.0 { "inf" } else { "-inf" })
        }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Number, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = Number;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a number")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Number, E> {
                Ok(Number(value))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Number, E> {
                Ok(Number(value as f64))
            }

            fn visit_str<E: Error>(self, value: &str) -> Result<Number, E> {
                match value {
                    "inf" => Ok(Number(f64::INFINITY)),
                    "-inf" => Ok(Number(f64::NEG_INFINITY)),
                    "nan" => Ok(Number(f64::NAN)),
                    _ => Err(E::invalid_value(serde::de::Unexpected::Str(value), &self)),
                }
            }
        }
        deserializer.deserialize_any(NumberVisitor)
    }
}

/// One value for every dof, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PerDof<T> {
    /// The same for every dof.
    All(T),
    /// One per dof, in dof order.
    Each(Vec<T>),
}

impl<T: Copy> PerDof<T> {
    /// The values of a robot's dofs, a single one for all that are `driven`, `else_` for the others; the length
    /// of a list is not checked here.
    pub fn spread<V: Copy>(&self, driven: &[bool], else_: V, value: impl Fn(T) -> V) -> Vec<V> {
        match self {
            PerDof::All(all) => driven
                .iter()
                .map(|&driven| if driven { value(*all) } else { else_ })
                .collect(),
            PerDof::Each(each) => each.iter().map(|&entry| value(entry)).collect(),
        }
    }
}

// serde's untagged enums lose what was wrong with the value; this keeps it
impl<'de, T: Deserialize<'de>> Deserialize<'de> for PerDof<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<PerDof<T>, D::Error> {
        struct PerDofVisitor<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for PerDofVisitor<T> {
            type Value = PerDof<T>;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("one value, or a list with one per dof")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<PerDof<T>, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(list)).map(PerDof::Each)
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<PerDof<T>, E> {
                T::deserialize(value.into_deserializer()).map(PerDof::All)
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<PerDof<T>, E> {
                T::deserialize(value.into_deserializer()).map(PerDof::All)
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<PerDof<T>, E> {
                T::deserialize(value.into_deserializer()).map(PerDof::All)
            }

            fn visit_str<E: Error>(self, value: &str) -> Result<PerDof<T>, E> {
                T::deserialize(value.into_deserializer()).map(PerDof::All)
            }
        }
        deserializer.deserialize_any(PerDofVisitor(PhantomData))
    }
}
