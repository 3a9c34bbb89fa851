//! Models that MuJoCo compiled, as safetensors: files of any bytes, and good files with arrays changed.

use std::fmt::Write;

use sim_model::{Description, MujocoOptions};

use super::files;

/// Models of the project's tests and examples, whose arrays are changed.
const BASES: [&[u8]; 4] = [
    include_bytes!("../../../examples/assets/cart/cart.safetensors"),
    include_bytes!("../../../sim-core/stages/recorded/tests/record_stages/passive.safetensors"),
    include_bytes!("../../../sim-core/stages/recorded/tests/record_stages/sensors.safetensors"),
    include_bytes!("../../data/recorded/machine_models/machine.safetensors"),
];
/// Reals that checks forget.
const REALS: [f64; 12] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-300,
    1e300,
    -1e300,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    1e9,
    0.5,
];
/// Integers that checks forget.
const INTEGERS: [i32; 8] = [0, 1, -1, i32::MAX, i32::MIN, 1 << 16, 1 << 24, 100];
/// Most rows that an array is given.
const ROWS_MAX: usize = 48;

/// A file of any bytes.
pub fn file(bytes: &[u8]) {
    let path = files::file("model.safetensors", bytes);
    match Description::from_mujoco(&path, MujocoOptions::named("robot")) {
        Ok(scene) => {
            // what is wrong with a scene as a whole is no fault of a reader
            let _ = scene.compile();
        }
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.len() < 1 << 16,
                "{} bytes: {message}",
                message.len()
            );
        }
    }
}

/// An array of a model.
#[derive(Clone)]
struct Array {
    name: String,
    dtype: String,
    shape: Vec<usize>,
    data: Vec<u8>,
}

impl Array {
    fn entry_bytes(&self) -> usize {
        match self.dtype.as_str() {
            "F64" => 8,
            "I32" => 4,
            _ => 1,
        }
    }

    /// Sets an entry, counted from the start and again from there.
    fn set(&mut self, place: u8, value: i16) {
        let bytes = self.entry_bytes();
        let entries = self.data.len() / bytes;
        if entries == 0 {
            return;
        }
        let first = bytes * (usize::from(place) % entries);
        let [kind, number] = value.to_le_bytes();
        let kind = usize::from(kind);
        let entry = &mut self.data[first..first + bytes];
        match bytes {
            8 => {
                let real = REALS.get(kind).copied();
                let real = real.unwrap_or(f64::from(value) / 256.0);
                entry.copy_from_slice(&real.to_le_bytes());
            }
            4 => {
                let integer = INTEGERS.get(kind).copied();
                let integer = integer.unwrap_or(i32::from(number as i8));
                entry.copy_from_slice(&integer.to_le_bytes());
            }
            _ => entry[0] = number,
        }
    }

    /// Gives it so many rows: the first ones, or those that are there over and over.
    fn resize(&mut self, rows: usize) {
        let row: usize = self.shape.iter().skip(1).product::<usize>() * self.entry_bytes();
        let before = self.data.clone();
        self.data = match before.is_empty() {
            true => vec![0; rows * row],
            false => before.iter().copied().cycle().take(rows * row).collect(),
        };
        self.shape[0] = rows;
    }
}

fn arrays_of(bytes: &[u8]) -> Vec<Array> {
    let (length, rest) = bytes
        .split_first_chunk::<8>()
        .expect("a length comes first");
    let (header, data) = rest.split_at(u64::from_le_bytes(*length) as usize);
    let header: serde_json::Value = serde_json::from_slice(header).expect("the header is JSON");
    let tensors = header.as_object().expect("it is an object").iter();
    let tensors = tensors.filter(|(name, _)| *name != "__metadata__");
    let number = |value: &serde_json::Value| value.as_u64().expect("it is a number") as usize;
    let numbers = |value: &serde_json::Value| -> Vec<usize> {
        let values = value.as_array().expect("it is a list");
        values.iter().map(number).collect()
    };
    tensors
        .map(|(name, tensor)| {
            let [start, end] = numbers(&tensor["data_offsets"])[..] else {
                panic!("two offsets")
            };
            Array {
                name: name.clone(),
                dtype: tensor["dtype"].as_str().expect("a type").to_owned(),
                shape: numbers(&tensor["shape"]),
                data: data[start..end].to_vec(),
            }
        })
        .collect()
}

fn written(arrays: &[Array]) -> Vec<u8> {
    let mut header = String::from("{");
    let mut data = Vec::new();
    for array in arrays {
        let start = data.len();
        data.extend_from_slice(&array.data);
        let comma = if start == 0 && header.len() == 1 {
            ""
        } else {
            ","
        };
        let (name, dtype, shape, end) = (&array.name, &array.dtype, &array.shape, data.len());
        let row = format!(
            "{comma}\"{name}\":{{\"dtype\":\"{dtype}\",\"shape\":{shape:?},\"data_offsets\":[{start},{end}]}}"
        );
        let _ = header.write_str(&row);
    }
    header.push('}');
    let length = (header.len() as u64).to_le_bytes();
    [&length[..], header.as_bytes(), &data].concat()
}

thread_local! {
    static ARRAYS: Vec<Vec<Array>> = BASES.map(arrays_of).into();
}

/// Changes of a good model: which one, then six bytes each: the array, what is done to it, a place and a value.
pub fn arrays(bytes: &[u8]) {
    let Some((&base, changes)) = bytes.split_first() else {
        return;
    };
    let mut model = ARRAYS.with(|all| all[usize::from(base) % all.len()].clone());
    for &[low, high, action, place, first, second] in changes.as_chunks::<6>().0 {
        let place_of = usize::from(u16::from_le_bytes([low, high])) % model.len();
        let count = model.len();
        let array = &mut model[place_of];
        match action % 8 {
            0..=3 => array.set(place, i16::from_le_bytes([first, second])),
            4 | 5 => array.resize(usize::from(place) % ROWS_MAX),
            6 if count > 1 => drop(model.remove(place_of)),
            _ => {
                // an array of another model in its place
                let name = &array.name;
                let other = ARRAYS.with(|all| {
                    let other = &all[usize::from(place) % all.len()];
                    other.iter().find(|other| other.name == *name).cloned()
                });
                if let Some(other) = other {
                    *array = other;
                }
            }
        }
    }
    file(&written(&model));
}
