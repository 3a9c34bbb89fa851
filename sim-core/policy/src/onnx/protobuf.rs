//! The encoding of protocol buffers: fields of a message, as they come.
//!
//! Written here because the crates that read it bring a code generator or their own build step, for six messages.
//! <https://protobuf.dev/programming-guides/encoding/>

use crate::PolicyError;

/// The value of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value<'a> {
    Varint(u64),
    Fixed32([u8; 4]),
    Fixed64([u8; 8]),
    /// Text, bytes, a message, or packed numbers.
    Bytes(&'a [u8]),
}

impl<'a> Value<'a> {
    /// Bytes of a text or message.
    pub(super) fn bytes(self) -> Result<&'a [u8], PolicyError> {
        match self {
            Value::Bytes(bytes) => Ok(bytes),
            _ => Err(damaged("a message has a number in its place")),
        }
    }

    pub(super) fn text(self) -> Result<&'a str, PolicyError> {
        std::str::from_utf8(self.bytes()?).map_err(|_| damaged("a text is not UTF-8"))
    }

    pub(super) fn integer(self) -> Result<i64, PolicyError> {
        match self {
            Value::Varint(number) => Ok(number as i64),
            _ => Err(damaged("a whole number has another type")),
        }
    }

    pub(super) fn float(self) -> Result<f32, PolicyError> {
        match self {
            Value::Fixed32(bytes) => Ok(f32::from_le_bytes(bytes)),
            _ => Err(damaged("a number has another type")),
        }
    }

    /// Whole numbers of a repeated field: one, or packed ones.
    pub(super) fn integers(self, to: &mut Vec<i64>) -> Result<(), PolicyError> {
        match self {
            Value::Bytes(mut bytes) => {
                while !bytes.is_empty() {
                    to.push(varint(&mut bytes)? as i64);
                }
            }
            single => to.push(single.integer()?),
        }
        Ok(())
    }

    /// Numbers of a repeated field in single precision.
    pub(super) fn floats(self, to: &mut Vec<f32>) -> Result<(), PolicyError> {
        match self {
            Value::Bytes(bytes) => {
                let (numbers, rest) = bytes.as_chunks::<4>();
                if !rest.is_empty() {
                    return Err(damaged("packed numbers end within one"));
                }
                to.extend(numbers.iter().map(|&bytes| f32::from_le_bytes(bytes)));
            }
            single => to.push(single.float()?),
        }
        Ok(())
    }

    /// Numbers of a repeated field in double precision.
    pub(super) fn doubles(self, to: &mut Vec<f32>) -> Result<(), PolicyError> {
        match self {
            Value::Bytes(bytes) => {
                let (numbers, rest) = bytes.as_chunks::<8>();
                if !rest.is_empty() {
                    return Err(damaged("packed numbers end within one"));
                }
                to.extend(
                    numbers
                        .iter()
                        .map(|&bytes| f64::from_le_bytes(bytes) as f32),
                );
            }
            Value::Fixed64(bytes) => to.push(f64::from_le_bytes(bytes) as f32),
            _ => return Err(damaged("a number has another type")),
        }
        Ok(())
    }
}

/// Calls `take` with number and value of each field of a message.
///
/// # Errors
/// [`PolicyError::File`] for bytes that are no message; errors of `take`.
pub(super) fn fields<'a>(
    mut message: &'a [u8],
    mut take: impl FnMut(u64, Value<'a>) -> Result<(), PolicyError>,
) -> Result<(), PolicyError> {
    while !message.is_empty() {
        let key = varint(&mut message)?;
        let value = match key & 7 {
            0 => Value::Varint(varint(&mut message)?),
            1 => Value::Fixed64(fixed(&mut message)?),
            2 => {
                let length = varint(&mut message)?;
                let cut = usize::try_from(length)
                    .ok()
                    .and_then(|length| message.split_at_checked(length));
                let (bytes, rest) = cut.ok_or_else(|| damaged("it ends within a field"))?;
                message = rest;
                Value::Bytes(bytes)
            }
            5 => Value::Fixed32(fixed(&mut message)?),
            kind => return Err(damaged(&format!("a field has the unknown type {kind}"))),
        };
        take(key >> 3, value)?;
    }
    Ok(())
}

fn fixed<const BYTES: usize>(message: &mut &[u8]) -> Result<[u8; BYTES], PolicyError> {
    let (bytes, rest) = message
        .split_first_chunk::<BYTES>()
        .ok_or_else(|| damaged("it ends within a number"))?;
    *message = rest;
    Ok(*bytes)
}

fn varint(message: &mut &[u8]) -> Result<u64, PolicyError> {
    let mut number = 0u64;
    for place in 0..10 {
        let (&byte, rest) = message
            .split_first()
            .ok_or_else(|| damaged("it ends within a number"))?;
        *message = rest;
        number |= u64::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            return Ok(number);
        }
    }
    Err(damaged("a number has more than 64 bits"))
}

/// Name and value of a text.
pub(super) fn entry(bytes: &[u8]) -> Result<(String, String), PolicyError> {
    let (mut name, mut text) = (String::new(), String::new());
    fields(bytes, |number, value| {
        match number {
            1 => name = value.text()?.to_owned(),
            2 => text = value.text()?.to_owned(),
            _ => {}
        }
        Ok(())
    })?;
    Ok((name, text))
}

pub(super) fn damaged(problem: &str) -> PolicyError {
    PolicyError::File {
        problem: problem.to_owned(),
    }
}
