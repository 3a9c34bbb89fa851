//! The elements of a file that URDF knows, checked, in the form in which urdf-rs reads a robot.
//!
//! urdf-rs describes a robot by types that serde fills, and its own reader prints and parses the XML twice to get there.
//! The scan has the same elements already, so it hands them to those types.

use std::borrow::Cow;

use serde::Deserialize;
use serde::de::value::{Error, MapAccessDeserializer, MapDeserializer, SeqDeserializer};
use serde::de::{Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

use super::table::Tag;

/// An element that the table knows, with what it knows of its attributes and children.
pub(super) struct Element<'a> {
    pub name: &'static str,
    /// Name and value of each attribute that is given or has a default.
    pub attributes: Vec<(&'static str, Cow<'a, str>)>,
    /// In file order.
    pub children: Vec<Element<'a>>,
}

impl Element<'_> {
    /// An element of this kind, without attributes and children.
    pub fn empty(tag: &'static Tag) -> Element<'static> {
        Element {
            name: tag.name,
            attributes: Vec::new(),
            children: Vec::new(),
        }
    }

    /// The robot that this element, a `<robot>`, describes.
    ///
    /// # Errors
    /// What urdf-rs cannot take. The table asks for all that urdf-rs asks for, so this is a fault of the table.
    pub fn robot(&self) -> Result<urdf_rs::Robot, Error> {
        urdf_rs::Robot::deserialize(Field::Elements(vec![self]))
    }

    /// Attributes, then children; those of one name are one field.
    fn fields(&self) -> impl Iterator<Item = (&'static str, Field<'_>)> {
        let attributes = self.attributes.iter();
        let attributes = attributes.map(|(name, value)| (*name, Field::Attribute(value)));
        let mut groups: Vec<(&'static str, Vec<&Element<'_>>)> = Vec::new();
        for child in &self.children {
            match groups.iter_mut().find(|(name, _)| *name == child.name) {
                Some((_, group)) => group.push(child),
                None => groups.push((child.name, vec![child])),
            }
        }
        let children = groups.into_iter();
        attributes.chain(children.map(|(name, group)| (name, Field::Elements(group))))
    }
}

/// A field of a type of urdf-rs.
enum Field<'a> {
    Attribute(&'a str),
    /// All children of one name; never empty.
    Elements(Vec<&'a Element<'a>>),
}

impl<'de> IntoDeserializer<'de> for Field<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Field<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Field::Attribute(value) => visitor.visit_borrowed_str(value),
            Field::Elements(elements) => {
                visitor.visit_map(MapDeserializer::new(elements[0].fields()))
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_some(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Field::Attribute(_) => self.deserialize_any(visitor),
            Field::Elements(elements) => {
                let each = elements.into_iter();
                let each = each.map(|element| Field::Elements(vec![element]));
                visitor.visit_seq(SeqDeserializer::new(each))
            }
        }
    }

    /// A joint's type is an attribute; a geometry's variant is the name of its only child.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self {
            Field::Attribute(value) => value
                .into_deserializer()
                .deserialize_enum(name, variants, visitor),
            Field::Elements(elements) => visitor.visit_enum(MapAccessDeserializer::new(
                MapDeserializer::new(elements[0].fields()),
            )),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct
        newtype_struct tuple tuple_struct map struct identifier ignored_any
    }
}
