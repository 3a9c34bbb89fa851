//! What is collected of each frame, in one array of bytes.

use sim_protocol::{ALIGNMENT, Table};

use super::question::Asked;

/// An array of the answer.
struct Array {
    /// First byte in the answer.
    start: usize,
    /// Bytes of a frame.
    bytes: usize,
    /// First byte in the arena of a frame; none of actions and observations.
    source: Option<usize>,
}

/// The answer while it grows.
pub(super) struct Answer {
    arrays: Vec<Array>,
    bytes: Vec<u8>,
}

impl Answer {
    /// Bytes of an answer without its memory, and its arrays: fields, actions, observations.
    fn lay_out(asked: &Asked, worlds: usize, table: &Table) -> Result<(Vec<Array>, usize), String> {
        let (question, network) = (&asked.question, &asked.network);
        let head = Table::head_bytes(table.rows().len());
        let mut sizes = Vec::new();
        for name in &question.fields {
            let row = table
                .row(name)
                .ok_or_else(|| format!("frames carry no `{name}`; add it to `fields` at launch"))?;
            sizes.push((row.bytes, Some(row.offset - head)));
        }
        let widths = [network.outputs(), network.inputs()];
        for (width, _) in widths.iter().zip(question.collects).filter(|pair| pair.1) {
            sizes.push((worlds * width * size_of::<f32>(), None));
        }
        let (mut arrays, mut start) = (Vec::new(), 0usize);
        for (bytes, source) in sizes {
            arrays.push(Array {
                start,
                bytes,
                source,
            });
            let end = bytes
                .checked_mul(question.frames)
                .and_then(|all| all.checked_next_multiple_of(ALIGNMENT))
                .and_then(|all| start.checked_add(all));
            start = end.ok_or_else(|| format!("{} frames are too many", question.frames))?;
        }
        Ok((arrays, start))
    }

    /// Room for an answer; `check_room` refuses what would not fit with `others`, bytes that are needed besides.
    ///
    /// # Errors
    /// A field that frames do not carry; too little memory.
    pub(super) fn new(
        asked: &Asked,
        worlds: usize,
        table: &Table,
        others: u64,
        check_room: impl Fn(u64) -> Result<(), String>,
    ) -> Result<Answer, String> {
        let (arrays, bytes) = Answer::lay_out(asked, worlds, table)?;
        let copies = (bytes as u64).saturating_mul(2);
        check_room(others.saturating_add(copies))?;
        Ok(Answer {
            arrays,
            bytes: vec![0; bytes],
        })
    }

    /// Collects a frame, with the action and observation that led to it.
    pub(super) fn collect(
        &mut self,
        asked: &Asked,
        frame: usize,
        arena: &[u64],
        actions: &[f32],
        observations: &[f32],
    ) {
        let arena: &[u8] = bytemuck::cast_slice(arena);
        let [with_actions, _] = asked.question.collects;
        let mut others = [(with_actions, actions), (true, observations)]
            .into_iter()
            .filter(|pair| pair.0)
            .map(|pair| bytemuck::cast_slice(pair.1));
        for array in &self.arrays {
            let to = &mut self.bytes[array.start + frame * array.bytes..][..array.bytes];
            match array.source {
                Some(source) => to.copy_from_slice(&arena[source..][..array.bytes]),
                None => to.copy_from_slice(others.next().expect("it has a source")),
            }
        }
    }

    /// All bytes, with the policy's memory.
    pub(super) fn finish(mut self, memory: &[f64]) -> Vec<u8> {
        self.bytes
            .extend(memory.iter().flat_map(|value| value.to_le_bytes()));
        self.bytes
    }
}
