//! A recording as a WGSL compute shader: one world a thread, one `let` a value.
//!
//! Memory is a structure of arrays with the world innermost, so that neighbouring threads touch
//! neighbouring numbers. The number of worlds and the size of a workgroup are constants of the
//! pipeline (`worlds`, `workgroup`): the program's text depends on neither.
//!
//! Memory comes in vectors of four numbers, since a driver's compile time grows with the accesses:
//! number n of a world is component n % 4 of vector `(n / 4) * worlds + world`. Binding 0 holds the
//! fields: input i is number `inputs[i]`. Binding 1 holds the rows: number k of row r of a table is
//! number `base + r * stride + k`, and is declared only where a table is used. Both hold whole
//! vectors: the last one is read and written although not all of it be used, but a number that the
//! text does not write keeps its bits. Bindings 2 and 3, too, are declared only where they are read:
//! the tables of the model, the same for every world, of numbers (`numbers[base + r * stride + k]`)
//! and of indices. They are buffers, not constants, so that a program does not grow with its model's tables.
//!
//! What WGSL leaves open: an implementation may fuse a product with a sum, treat numbers below
//! 2^-126 as 0, and assume that nothing is infinite or not a number. An infinite constant is
//! therefore printed as the largest finite number of its sign; one that is not a number was refused
//! by the recorder.

use super::Recording;
use super::pack::WIDTH;
use super::tree::{Binary, Cell, Entry, Op, Operand, Quad, Rounds, Row, Statement, Unary};
use std::collections::{BTreeMap, HashMap};
use std::fmt::{self, Write};

/// Names of a vector's components.
const COMPONENTS: [char; WIDTH] = ['x', 'y', 'z', 'w'];

/// What a program is called and where it finds its numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramOptions {
    /// Name of the entry point.
    pub entry: String,
    /// Threads of a workgroup, unless the pipeline overrides `workgroup`.
    pub workgroup: u32,
    /// Field of each input; none: 0, 1, 2, …
    pub inputs: Option<Vec<u32>>,
    /// Field of each output; none: the fields after the inputs'. It may be that of an input: all
    /// inputs are read before any output is written.
    pub outputs: Option<Vec<u32>>,
    /// Fields of numbers: a world for which one of them is not 0 is left alone.
    pub unless: Vec<u32>,
    /// Is the world of a thread found in a list? At binding 4 stand workgroups, 1, 1 and the worlds of the list, at binding 5 the list.
    pub is_listed: bool,
}

impl ProgramOptions {
    /// The field of each input and of each output.
    ///
    /// # Panics
    /// If `inputs` or `outputs` does not give a field for each of the recording's.
    pub fn fields(&self, recording: &Recording) -> (Vec<u32>, Vec<u32>) {
        let n = recording.inputs() as u32;
        let fields = |given: &Option<Vec<u32>>, first: u32, count: usize| {
            let fields = given
                .clone()
                .unwrap_or_else(|| (first..first + count as u32).collect());
            assert_eq!(
                fields.len(),
                count,
                "a field for each input and output of the recording"
            );
            fields
        };
        (
            fields(&self.inputs, 0, recording.inputs()),
            fields(&self.outputs, n, recording.outputs()),
        )
    }
}

impl Default for ProgramOptions {
    fn default() -> ProgramOptions {
        ProgramOptions {
            entry: "main".to_owned(),
            workgroup: 32,
            inputs: None,
            outputs: None,
            unless: Vec::new(),
            is_listed: false,
        }
    }
}

/// The recording as WGSL.
///
/// # Panics
/// If `inputs` or `outputs` does not give a field for each of the recording's.
pub fn wgsl(recording: &Recording, options: &ProgramOptions) -> String {
    let (inputs, outputs) = options.fields(recording);
    let recording = &recording.packed();
    let mut printer = Printer {
        recording,
        single: recording.single_parts(),
        text: String::new(),
        indent: 1,
    };
    printer
        .program(options, &inputs, &outputs)
        .expect("writing to a string does not fail");
    printer.text
}

struct Printer<'a> {
    recording: &'a Recording,
    /// Vectors of which one number alone is used, and which: only that is read.
    single: HashMap<u32, usize>,
    text: String,
    indent: usize,
}

/// Writes one line, indented.
macro_rules! line {
    ($printer:ident, $($arg:tt)*) => {{
        for _ in 0..$printer.indent {
            $printer.text.push_str("    ");
        }
        writeln!($printer.text, $($arg)*)
    }};
}

impl Printer<'_> {
    fn program(
        &mut self,
        options: &ProgramOptions,
        inputs: &[u32],
        outputs: &[u32],
    ) -> fmt::Result {
        writeln!(self.text, "override worlds: u32;")?;
        writeln!(
            self.text,
            "override workgroup: u32 = {}u;",
            options.workgroup
        )?;
        writeln!(
            self.text,
            "@group(0) @binding(0) var<storage, read_write> fields: array<vec4<f32>>;"
        )?;
        if self.recording.scratch() > 0 {
            writeln!(
                self.text,
                "@group(0) @binding(1) var<storage, read_write> scratch: array<vec4<f32>>;"
            )?;
        }
        let (numbers, indices) = self.recording.reads_tables();
        if numbers {
            writeln!(
                self.text,
                "@group(0) @binding(2) var<storage, read> numbers: array<f32>;"
            )?;
        }
        if indices {
            writeln!(
                self.text,
                "@group(0) @binding(3) var<storage, read> indices: array<u32>;"
            )?;
        }
        if options.is_listed {
            writeln!(
                self.text,
                "@group(0) @binding(4) var<storage, read> left: array<u32>;\n\
                 @group(0) @binding(5) var<storage, read> list: array<u32>;"
            )?;
        }
        writeln!(self.text, "\n@compute @workgroup_size(workgroup)")?;
        writeln!(
            self.text,
            "fn {}(@builtin(global_invocation_id) thread: vec3<u32>) {{",
            options.entry
        )?;
        if options.is_listed {
            line!(self, "if (thread.x >= left[3]) {{ return; }}")?;
            line!(self, "let world = list[thread.x];")?;
        } else {
            line!(self, "let world = thread.x;")?;
            line!(self, "if (world >= worlds) {{ return; }}")?;
        }
        for field in &options.unless {
            let (quad, part) = place_of_field(*field);
            line!(
                self,
                "if (fields[{quad}u * worlds + world].{part} != 0.0f) {{ return; }}"
            )?;
        }
        let read = self.inputs(inputs)?;
        self.block(&self.recording.body)?;
        self.outputs(inputs, outputs, &read)?;
        writeln!(self.text, "}}")
    }

    /// Reads the live inputs, vector by vector; returns the vectors that are read whole.
    fn inputs(&mut self, inputs: &[u32]) -> Result<Vec<u32>, fmt::Error> {
        let mut quads: BTreeMap<u32, Vec<(u32, char)>> = BTreeMap::new();
        for i in self.recording.live_inputs() {
            let (quad, part) = place_of_field(inputs[i as usize]);
            quads.entry(quad).or_default().push((i, part));
        }
        let mut whole = Vec::new();
        for (quad, numbers) in quads {
            if let [(i, part)] = numbers[..] {
                line!(self, "let x{i} = fields[{quad}u * worlds + world].{part};")?;
                continue;
            }
            line!(self, "let q{quad} = fields[{quad}u * worlds + world];")?;
            for (i, part) in numbers {
                line!(self, "let x{i} = q{quad}.{part};")?;
            }
            whole.push(quad);
        }
        Ok(whole)
    }

    /// Writes the outputs, vector by vector; one that is an input in its own field is there already.
    fn outputs(&mut self, inputs: &[u32], outputs: &[u32], read: &[u32]) -> fmt::Result {
        let mut quads: BTreeMap<u32, [Option<String>; WIDTH]> = BTreeMap::new();
        for (x, field) in self.recording.outputs.iter().zip(outputs) {
            let stays = match *x {
                Operand::Value(number) => inputs.get(number as usize) == Some(field),
                _ => false,
            };
            if !stays {
                let place = *field as usize % WIDTH;
                quads.entry(field / WIDTH as u32).or_default()[place] = Some(self.operand(*x));
            }
        }
        for (quad, mut numbers) in quads {
            let place = format!("fields[{quad}u * worlds + world]");
            let count = numbers.iter().flatten().count();
            let mut is_read = read.contains(&quad);
            if count + 1 == WIDTH && !is_read {
                line!(self, "let q{quad} = {place};")?;
                is_read = true;
            }
            if count > 1 && is_read {
                for (number, part) in numbers.iter_mut().zip(COMPONENTS) {
                    number.get_or_insert_with(|| format!("q{quad}.{part}"));
                }
            }
            self.write(&place, &numbers)?;
        }
        Ok(())
    }

    /// Writes those numbers of a vector that are given.
    fn write(&mut self, place: &str, numbers: &[Option<String>; WIDTH]) -> fmt::Result {
        if let [Some(x), Some(y), Some(z), Some(w)] = numbers {
            return line!(self, "{place} = vec4<f32>({x}, {y}, {z}, {w});");
        }
        for (number, part) in numbers.iter().zip(COMPONENTS) {
            if let Some(x) = number {
                line!(self, "{place}.{part} = {x};")?;
            }
        }
        Ok(())
    }

    fn block(&mut self, body: &[Statement]) -> fmt::Result {
        for statement in body {
            self.statement(statement)?;
        }
        Ok(())
    }

    fn nested(&mut self, body: &[Statement]) -> fmt::Result {
        self.indent += 1;
        self.block(body)?;
        self.indent -= 1;
        line!(self, "}}")
    }

    /// v: variable, n: rows of a list, i: index of a loop or fresh row, t: value, x: input.
    fn statement(&mut self, statement: &Statement) -> fmt::Result {
        match statement {
            Statement::Let(number) => {
                let op = self.recording.values[*number as usize];
                if op.is_inline() {
                    return Ok(());
                }
                if let (Op::Quad(quad), Some(part)) = (op, self.single.get(number)) {
                    let part = COMPONENTS[*part];
                    return line!(self, "let t{number} = {}.{part};", vector(&quad));
                }
                line!(self, "let t{number} = {};", self.op(op))
            }
            Statement::Var { name, value } => {
                line!(self, "var v{name} = {};", self.operand(*value))
            }
            Statement::Set { name, value } => {
                line!(self, "v{name} = {};", self.operand(*value))
            }
            Statement::Store { cell, value } => {
                line!(self, "{} = {};", scratch(cell), self.operand(*value))
            }
            Statement::StoreQuad { quad, numbers } => {
                let numbers = numbers.map(|x| x.map(|x| self.operand(x)));
                self.write(&vector(quad), &numbers)
            }
            Statement::List { name, rows } => match rows.constant() {
                Some(rows) => line!(self, "var n{name} = {}u;", rows as u32),
                None => line!(self, "var n{name} = u32({});", self.operand(*rows)),
            },
            Statement::When { mask, body } => {
                line!(self, "if ({}) {{", self.operand(*mask))?;
                self.nested(body)
            }
            Statement::Push {
                list,
                capacity,
                row,
                mask,
                body,
            } => {
                line!(self, "if ({}) {{", self.operand(*mask))?;
                self.indent += 1;
                if !body.is_empty() {
                    line!(self, "let i{row} = n{list};")?;
                }
                line!(self, "n{list} = n{list} + 1u;")?;
                if !body.is_empty() {
                    line!(self, "if (i{row} < {capacity}u) {{")?;
                    self.nested(body)?;
                }
                self.indent -= 1;
                line!(self, "}}")
            }
            Statement::Loop {
                index: i,
                rounds,
                body,
            } => {
                let (first, end) = match *rounds {
                    Rounds::Span { first, end } => (index(first), index(end)),
                    Rounds::Rows { list, capacity } => {
                        line!(self, "let end{i} = min(n{list}, {capacity}u);")?;
                        ("0u".to_owned(), format!("end{i}"))
                    }
                };
                line!(self, "for (var i{i} = {first}; i{i} < {end}; i{i}++) {{")?;
                self.nested(body)
            }
            Statement::Stop(mask) => line!(self, "if ({}) {{ break; }}", self.operand(*mask)),
        }
    }

    fn op(&self, op: Op) -> String {
        let x = |a: Operand| self.operand(a);
        match op {
            Op::Input(i) => format!("x{i}"),
            Op::Get(name) => format!("v{name}"),
            Op::Load(cell) => scratch(&cell),
            Op::Quad(quad) => vector(&quad),
            Op::Part(four, _) if self.single.contains_key(&four) => format!("t{four}"),
            Op::Part(four, k) => format!("t{four}.{}", COMPONENTS[k]),
            Op::Count(list) => format!("f32(n{list})"),
            Op::Unary(unary, a) => match unary {
                Unary::Neg => format!("(-{})", x(a)),
                Unary::Not => format!("(!{})", x(a)),
                Unary::Sqrt => format!("sqrt({})", x(a)),
                Unary::Abs => format!("abs({})", x(a)),
                Unary::Round => format!("round({})", x(a)),
            },
            Op::Binary(binary, a, b) => {
                let (a, b) = (x(a), x(b));
                match binary {
                    Binary::Add => format!("{a} + {b}"),
                    Binary::Sub => format!("{a} - {b}"),
                    Binary::Mul => format!("{a} * {b}"),
                    Binary::Div => format!("{a} / {b}"),
                    Binary::Min => format!("min({a}, {b})"),
                    Binary::Max => format!("max({a}, {b})"),
                    Binary::Lt => format!("{a} < {b}"),
                    Binary::And => format!("{a} && {b}"),
                    Binary::Or => format!("{a} || {b}"),
                }
            }
            Op::Fma(a, b, c) => format!("fma({}, {}, {})", x(a), x(b), x(c)),
            // WGSL names the value of the false case first
            Op::Select(mask, a, b) => format!("select({}, {}, {})", x(b), x(a), x(mask)),
            Op::Number(row) => format!("f32({})", index(row)),
            Op::Constant(Entry { table, row, number }) => {
                format!("numbers[{}]", place(table.base + number, table.stride, row))
            }
            Op::Pick { table, row, number } => {
                let first = table.base + number;
                format!("numbers[u32({}) * {}u + {first}u]", x(row), table.stride)
            }
            Op::Index { entry, .. } => {
                let Entry { table, row, number } = entry;
                format!("indices[{}]", place(table.base + number, table.stride, row))
            }
            Op::After(row, n) => format!("{} + u32({})", index(row), x(n)),
        }
    }

    fn operand(&self, x: Operand) -> String {
        match x {
            Operand::Constant(bits) => literal(f32::from_bits(bits)),
            Operand::Truth(mask) => mask.to_string(),
            Operand::Value(number) => match self.recording.values[number as usize] {
                op if op.is_inline() => self.op(op),
                _ => format!("t{number}"),
            },
        }
    }
}

fn index(row: Row) -> String {
    match row {
        Row::At(i) => format!("{i}u"),
        Row::Name(name) => format!("i{name}"),
        Row::Value(number) => format!("t{number}"),
    }
}

/// Where a number of a row stands, which is `first` in row 0.
fn place(first: usize, stride: usize, row: Row) -> String {
    match row {
        Row::At(i) => format!("{}u", first + i * stride),
        _ => format!("{} * {stride}u + {first}u", index(row)),
    }
}

/// A number whose place in its vector is found at run time.
fn scratch(cell: &Cell) -> String {
    let Cell { table, row, number } = cell;
    let place = place(table.base + number, table.stride, *row);
    format!("scratch[({place}) / 4u * worlds + world][({place}) % 4u]")
}

fn vector(quad: &Quad) -> String {
    let place = place(quad.first, quad.stride, quad.row);
    match quad.row {
        Row::At(_) => format!("scratch[{place} * worlds + world]"),
        _ => format!("scratch[({place}) * worlds + world]"),
    }
}

/// The vector that a field lies in, and its component.
fn place_of_field(field: u32) -> (u32, char) {
    let width = WIDTH as u32;
    (field / width, COMPONENTS[(field % width) as usize])
}

/// The shortest decimal that reads back as the same `f32`; infinities as the largest number.
fn literal(x: f32) -> String {
    assert!(
        !x.is_nan(),
        "the recorder refuses constants that are not numbers"
    );
    let x = x.clamp(f32::MIN, f32::MAX);
    if x < 0.0 {
        format!("({x:?}f)")
    } else {
        format!("{x:?}f")
    }
}
