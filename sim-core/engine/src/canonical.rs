//! Numbers of frames that are the same on every device: zeros have no sign, and what is below 2^-126 is 0, since GPUs may flush it.
//! `backend/gpu/kernels/show.rs` has the same for frames of a GPU.

use sim_physics::arrays::{Dtype, Layout};

/// Bits of a float's exponent.
const EXPONENT: u32 = 0x7f80_0000;

/// Changes the floats of a frame so.
pub(crate) fn make_canonical(layout: &Layout, arena: &mut [u64]) {
    let words: &mut [f32] = bytemuck::cast_slice_mut(arena);
    for slot in layout.slots.iter().filter(|slot| slot.dtype == Dtype::F32) {
        make_floats_canonical(&mut words[slot.offset / 4..(slot.offset + slot.bytes) / 4]);
    }
}

/// Changes these floats so.
pub(crate) fn make_floats_canonical(floats: &mut [f32]) {
    for x in floats {
        if x.to_bits() & EXPONENT == 0 {
            *x = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim_physics::arrays::{Field, Slot};

    #[test]
    fn zeros_lose_their_sign_and_smaller_numbers_become_zero() {
        let slot = |field, dtype, offset| Slot {
            field,
            dtype,
            shape: vec![4],
            offset,
            bytes: 16,
        };
        let layout = Layout {
            slots: vec![
                slot(Field::JointQ, Dtype::F32, 0),
                slot(Field::Status, Dtype::U32, 16),
            ],
            bytes: 32,
        };
        let floats = [-0.0, -1e-40, f32::MIN_POSITIVE, -2.5].map(f32::to_bits);
        let mut arena = [0_u64; 4];
        let words: &mut [u32] = bytemuck::cast_slice_mut(&mut arena);
        words[..4].copy_from_slice(&floats);
        words[4..].copy_from_slice(&floats);
        make_canonical(&layout, &mut arena);
        let words: &[u32] = bytemuck::cast_slice(&arena);
        assert_eq!(words[..4], [0, 0, floats[2], floats[3]]);
        assert_eq!(words[4..], floats);
    }
}
