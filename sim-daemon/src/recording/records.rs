//! Records of a recording: written one after the other into words, and checked when they are read.

/// What a recording consists of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Record<'a> {
    /// JSON of the daemon's [`sim_protocol::Description`].
    Head(&'a [u8]),
    /// All worlds at this place, as a snapshot.
    State(&'a [u8]),
    /// Something that was carried out.
    Command(RecordedCommand<'a>),
    /// So many entries were lost here.
    Gap(u64),
    /// Why the recording ended: one sentence.
    End(&'a str),
}

/// A command that was carried out, and what came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RecordedCommand<'a> {
    /// A [`sim_protocol::Op`].
    pub(super) op: u32,
    /// Rows of its field table.
    pub(super) rows: u32,
    /// Field table and arrays.
    pub(super) words: &'a [u64],
    /// Digests of its frame; none when the inputs were set and no frame was made.
    pub(super) digests: &'a [u32],
    /// Arrays of its frame that were asked for, each padded to 64 bytes.
    pub(super) observed: &'a [u64],
}

const HEAD: u64 = 1;
const STATE: u64 = 2;
const COMMAND: u64 = 3;
const GAP: u64 = 4;
const END: u64 = 5;
/// Words before the words of a record.
const RECORD_HEAD: usize = 2;
/// Words before the arrays of a command.
const COMMAND_HEAD: usize = 4;

impl Record<'_> {
    /// Words that it takes.
    pub(super) fn words(&self) -> usize {
        let of_bytes = |bytes: &[u8]| 1 + bytes.len().div_ceil(8);
        RECORD_HEAD
            + match self {
                Record::Head(bytes) | Record::State(bytes) => of_bytes(bytes),
                Record::End(why) => of_bytes(why.as_bytes()),
                Record::Gap(_) => 1,
                Record::Command(command) => {
                    let digests = command.digests.len().div_ceil(2);
                    COMMAND_HEAD + command.words.len() + digests + command.observed.len()
                }
            }
    }

    /// Appends it.
    pub(super) fn write(&self, to: &mut Vec<u64>) {
        let kind = match self {
            Record::Head(_) => HEAD,
            Record::State(_) => STATE,
            Record::Command(_) => COMMAND,
            Record::Gap(_) => GAP,
            Record::End(_) => END,
        };
        to.extend([kind, (self.words() - RECORD_HEAD) as u64]);
        match self {
            Record::Head(bytes) | Record::State(bytes) => write_bytes(bytes, to),
            Record::End(why) => write_bytes(why.as_bytes(), to),
            Record::Gap(lost) => to.push(*lost),
            Record::Command(command) => {
                to.extend([
                    u64::from(command.op) | u64::from(command.rows) << 32,
                    command.words.len() as u64,
                    command.digests.len() as u64,
                    command.observed.len() as u64,
                ]);
                to.extend(command.words);
                write_padded(bytemuck::cast_slice(command.digests), to);
                to.extend(command.observed);
            }
        }
    }
}

fn write_bytes(bytes: &[u8], to: &mut Vec<u64>) {
    to.push(bytes.len() as u64);
    write_padded(bytes, to);
}

fn write_padded(bytes: &[u8], to: &mut Vec<u64>) {
    let first = to.len();
    to.resize(first + bytes.len().div_ceil(8), 0);
    let room: &mut [u8] = bytemuck::cast_slice_mut(&mut to[first..]);
    room[..bytes.len()].copy_from_slice(bytes);
}

/// Takes the first record off `words`; none when they are not one.
pub(super) fn read<'a>(words: &mut &'a [u64]) -> Option<Record<'a>> {
    let (&[kind, count], rest) = words.split_first_chunk()?;
    let (body, rest) = rest.split_at_checked(usize::try_from(count).ok()?)?;
    let record = match kind {
        HEAD => Record::Head(read_bytes(body)?),
        STATE => Record::State(read_bytes(body)?),
        COMMAND => Record::Command(read_command(body)?),
        GAP => Record::Gap(*body.first()?),
        END => Record::End(str::from_utf8(read_bytes(body)?).ok()?),
        _ => return None,
    };
    *words = rest;
    Some(record)
}

fn read_bytes(body: &[u64]) -> Option<&[u8]> {
    let (&count, bytes) = body.split_first()?;
    bytemuck::cast_slice(bytes).get(..usize::try_from(count).ok()?)
}

fn read_command(body: &[u64]) -> Option<RecordedCommand<'_>> {
    let (&[op, words, digests, observed], rest) = body.split_first_chunk()?;
    let count = |number: u64| usize::try_from(number).ok();
    let (words, rest) = rest.split_at_checked(count(words)?)?;
    let digests = count(digests)?;
    let (padded, observed_words) = rest.split_at_checked(digests.div_ceil(2))?;
    (observed_words.len() == count(observed)?).then_some(RecordedCommand {
        op: op as u32,
        rows: (op >> 32) as u32,
        words,
        digests: &bytemuck::cast_slice(padded)[..digests],
        observed: observed_words,
    })
}
