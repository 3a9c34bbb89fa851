//! Changes words of SPIR-V that naga writes and has no option for.
//!
//! - A sum, product, quotient or `fma` is decorated with `NoContraction`, so that the driver rounds each as written. Otherwise Mesa
//!   simplifies `a - ((a + b) - b)` to 0, and a compensated sum loses its remainder (Kahan 1965). Without it an `fma` may round twice.
//! - A loop is marked `DontUnroll`: the rows of a solver's loop differ from world to world, and its unrolled code leaves the instruction
//!   cache.
//! - `FClamp` becomes `NClamp`. naga clamps a float before it becomes an integer. `NClamp` gives the lower limit for what is not a
//!   number, so an index is then 0.

/// Words before the first instruction.
const HEAD: usize = 5;

/// Opcodes of the float sum, difference, product and quotient.
const ARITHMETIC: [u32; 4] = [129, 131, 133, 136];
const EXT_INST_IMPORT: u32 = 11;
const EXT_INST: u32 = 12;
const LOOP_MERGE: u32 = 246;
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

/// The words of a module, changed.
pub(crate) fn patched(words: &[u32]) -> Vec<u32> {
    let mut patched = words.to_vec();
    let (mut decorations, mut first, mut at) = (Vec::new(), None, HEAD);
    let mut functions = None;
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
            _ if ARITHMETIC.contains(&code) => {
                decorations.extend([DECORATE, operands[1], NO_CONTRACTION]);
            }
            _ => {}
        }
        at += length;
    }
    let first = first.unwrap_or(words.len());
    patched.splice(first..first, decorations);
    patched
}

/// A literal string: bytes in little-endian words, up to a 0.
fn name(words: &[u32]) -> Vec<u8> {
    let bytes = words.iter().flat_map(|word| word.to_le_bytes());
    bytes.take_while(|byte| *byte != 0).collect()
}
