//! Changes words of SPIR-V that naga writes and has no option for.
//!
//! - A sum, product, quotient or `fma` is decorated with `NoContraction`, so that the driver rounds each as written. Otherwise Mesa
//!   simplifies `a - ((a + b) - b)` to 0, and a compensated sum loses its remainder (Kahan 1965). Without it an `fma` may round twice.
//! - A loop is marked `DontUnroll`: the rows of a solver's loop differ from world to world, and its unrolled code leaves the instruction
//!   cache.
//! - `FClamp` becomes `NClamp`. naga clamps a float before it becomes an integer. `NClamp` gives the lower limit for what is not a
//!   number, so an index is then 0.
//! - A barrier of a subgroup orders accesses to storage buffers, too: threads that share a world read what others of them wrote.

/// Words before the first instruction.
const HEAD: usize = 5;

/// Opcodes of the float sum, difference, product and quotient, and of a vector times a float.
const ARITHMETIC: [u32; 5] = [129, 131, 133, 136, 142];
const EXT_INST_IMPORT: u32 = 11;
const EXT_INST: u32 = 12;
const LOOP_MERGE: u32 = 246;
const CONSTANT: u32 = 43;
const CONTROL_BARRIER: u32 = 224;
/// Types and decorations. Decorations (71, 72) stand before types.
const DECORATIONS_OR_TYPES: [std::ops::RangeInclusive<u32>; 2] = [19..=39, 71..=72];

/// Instructions of `GLSL.std.450`.
const FCLAMP: u32 = 43;
const FMA: u32 = 50;
const NCLAMP: u32 = 81;

/// An instruction's first word: three words, and its opcode.
const DECORATE: u32 = 3 << 16 | 71;
const NO_CONTRACTION: u32 = 42;
const DONT_UNROLL: u32 = 2;
/// Memory that a barrier orders: storage buffers, and that of a subgroup.
const UNIFORM_MEMORY: u32 = 0x40;
const SUBGROUP_MEMORY: u32 = 0x80;
/// Place of the bound of all ids in the head.
const BOUND: usize = 3;

/// A constant of 32 bits.
struct Constant {
    /// Where the next instruction begins.
    end: usize,
    kind: u32,
    id: u32,
    value: u32,
}

/// The words of a module, changed.
pub(crate) fn patched(words: &[u32]) -> Vec<u32> {
    let mut patched = words.to_vec();
    let (mut decorations, mut first, mut at) = (Vec::new(), None, HEAD);
    let mut functions = None;
    let mut constants: Vec<Constant> = Vec::new();
    let mut barriers = Vec::new();
    while at < words.len() {
        let (length, code) = (words[at] as usize >> 16, words[at] & 0xffff);
        let operands = &words[at + 1..at + length];
        if (DECORATIONS_OR_TYPES.iter()).any(|codes| codes.contains(&code)) {
            first.get_or_insert(at);
        }
        match code {
            EXT_INST_IMPORT if name(&operands[1..]) == *b"GLSL.std.450" => {
                functions = Some(operands[0]);
            }
            EXT_INST if Some(operands[2]) == functions => match operands[3] {
                FMA => decorations.extend([DECORATE, operands[1], NO_CONTRACTION]),
                FCLAMP => patched[at + 4] = NCLAMP,
                _ => {}
            },
            LOOP_MERGE => patched[at + 3] |= DONT_UNROLL,
            CONSTANT if length == 4 => constants.push(Constant {
                end: at + length,
                kind: operands[0],
                id: operands[1],
                value: operands[2],
            }),
            CONTROL_BARRIER => barriers.push(at + 3),
            _ if ARITHMETIC.contains(&code) => {
                decorations.extend([DECORATE, operands[1], NO_CONTRACTION]);
            }
            _ => {}
        }
        at += length;
    }
    // from the end on, so that places before it stay
    order_storage(&mut patched, &constants, &barriers);
    let first = first.unwrap_or(words.len());
    patched.splice(first..first, decorations);
    patched
}

/// Gives the barriers of subgroups, whose semantics stand at these places, a constant that names storage buffers.
fn order_storage(words: &mut Vec<u32>, constants: &[Constant], barriers: &[usize]) {
    let known = |place: &&usize| {
        let constant = constants
            .iter()
            .find(|constant| constant.id == words[**place]);
        constant.filter(|constant| constant.value & SUBGROUP_MEMORY != 0)
    };
    let subgroup_barriers: Vec<usize> = barriers
        .iter()
        .filter(|place| known(place).is_some())
        .copied()
        .collect();
    let Some(old) = subgroup_barriers.first().and_then(|place| known(&place)) else {
        return;
    };
    let new = words[BOUND];
    words[BOUND] += 1;
    for place in subgroup_barriers {
        words[place] = new;
    }
    let more = [
        4 << 16 | CONSTANT,
        old.kind,
        new,
        old.value | UNIFORM_MEMORY,
    ];
    words.splice(old.end..old.end, more);
}

/// A literal string: bytes in little-endian words, up to a 0.
fn name(words: &[u32]) -> Vec<u8> {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.take_while(|byte| *byte != 0).collect()
}
