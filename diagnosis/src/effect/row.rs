//! A row of the catalogue with values, as the fields of an effect's type.

use crate::effect::catalogue::Effect;
use serde::de::value::{Error, MapDeserializer, StrDeserializer};
use serde::de::{Deserializer, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

/// The fields: the variant's name where the row has variants, then the values by their keys.
pub(super) type Fields<'a> = MapDeserializer<'a, std::vec::IntoIter<(&'a str, Field<'a>)>, Error>;

/// The fields of `effect` in its `variant` with `values`.
pub(super) fn fields<'a>(effect: &'a Effect, variant: usize, values: &[f64]) -> Fields<'a> {
    let variant = effect.variants.get(variant).map(|name| ("variant", Field::Variant(name)));
    let values = effect.parameter.iter().zip(values).map(|(p, x)| (p.key.as_str(), Field::Value(*x)));
    MapDeserializer::new(variant.into_iter().chain(values).collect::<Vec<_>>().into_iter())
}

/// A field.
pub(super) enum Field<'a> {
    /// Which variant.
    Variant(&'a str),
    /// A parameter's value.
    Value(f64),
}

impl<'a> IntoDeserializer<'a, Error> for Field<'a> {
    type Deserializer = Field<'a>;
    fn into_deserializer(self) -> Field<'a> {
        self
    }
}

impl<'de> Deserializer<'de> for Field<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self {
            Field::Variant(name) => visitor.visit_borrowed_str(name),
            Field::Value(x) => visitor.visit_f64(x),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self {
            Field::Variant(name) => visitor.visit_enum(StrDeserializer::new(name)),
            Field::Value(x) => visitor.visit_f64(x),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct
        newtype_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}
