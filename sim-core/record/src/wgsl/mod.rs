//! Prints a recording as a WGSL compute shader: one thread per lane of a world, one `let` per value.
//!
//! Memory is a structure of arrays with the world innermost, so that neighbouring threads touch
//! neighbouring scalars. The number of worlds and the size of a workgroup are constants of the
//! pipeline (`worlds`, `workgroup`): the source depends on neither.
//!
//! Memory comes in vectors of four scalars, since a driver's compile time grows with the accesses: scalar n of a world is component n % 4
//! of vector `(n / 4) * worlds + world`. The last vector is read and written whole, but a scalar that the kernel does not write keeps
//! its bits. A binding is declared only where it is used:
//!
//! | binding | content |
//! |---|---|
//! | 0 | fields: input i is scalar `inputs[i]` |
//! | 1 | rows in scratch memory: scalar k of row r of a table is scalar `base + r * stride + k` |
//! | 2 | scalars of the model's tables, the same for every world: `numbers[base + r * stride + k]` |
//! | 3 | indices of the model's tables |
//!
//! Tables are buffers, not constants, so that a program does not grow with its model's tables.
//!
//! WGSL lets an implementation fuse a product with a sum, flush values below 2^-126 to 0, and assume that nothing is infinite or NaN. An
//! infinite constant is therefore printed as the largest finite one of its sign. The recorder refuses NaN constants.

/// Writes one line, indented.
macro_rules! line {
    ($printer:ident, $($arg:tt)*) => {{
        for _ in 0..$printer.indent {
            $printer.text.push_str("    ");
        }
        writeln!($printer.text, $($arg)*)
    }};
}

mod corrections;
mod expression;
mod fields;

use crate::ir::recording::Recording;
use crate::ir::tree::{Bounds, Op, Operand, Statement};
use crate::passes::vectorize::WIDTH;
use expression::{COMPONENTS, Expressions, index, scratch, vector};
use fields::{Fields, place_of_field};
use std::fmt::{self, Write};

pub use corrections::Corrections;

/// How the lanes of a world exchange values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exchange {
    /// Shuffles of a subgroup. Its size must be a multiple of the lanes.
    #[default]
    Subgroup,
    /// Memory of a workgroup, which must be one world: where a world has more threads than a subgroup, or a driver has no shuffles.
    Workgroup,
}

/// Name of a program, and the fields of its inputs and outputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramOptions {
    /// Name of the entry point.
    pub entry: String,
    /// Threads of a workgroup, unless the pipeline overrides `workgroup`.
    pub workgroup: u32,
    /// Field of each input; none: 0, 1, 2, …
    pub inputs: Option<Vec<u32>>,
    /// Field of each output; none: the fields after the inputs'. It may be that of an input: such a
    /// field is written after all are read.
    pub outputs: Option<Vec<u32>>,
    /// Fields: a world for which one of them is not 0 is skipped.
    pub unless: Vec<u32>,
    /// Whether a thread takes its world from a list. Binding 4 holds workgroups, 1, 1 and the number of worlds, binding 5 the list.
    pub is_listed: bool,
    /// How lanes exchange values, if a world has several.
    pub exchange: Exchange,
    /// What is printed as a function, because the driver need not round it to the nearest number.
    pub corrections: Corrections,
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
            exchange: Exchange::default(),
            corrections: Corrections::default(),
        }
    }
}

/// The recording as WGSL.
///
/// # Panics
/// If `inputs` or `outputs` does not give a field for each of the recording's.
pub fn wgsl(recording: &Recording, options: &ProgramOptions) -> String {
    sequence(&[(recording, options)])
}

/// Recordings that run one after another, as one program of the first one's options. Each reads fields that those before it wrote.
///
/// # Panics
/// If there is none, if `inputs` or `outputs` does not give a field for each of a recording's, or if there are several and one has
/// several lanes or skips worlds.
pub fn sequence(parts: &[(&Recording, &ProgramOptions)]) -> String {
    let bodies: Vec<Body> = parts
        .iter()
        .map(|(recording, options)| Body::new(recording, options))
        .collect();
    let [(_, options), ..] = parts else {
        panic!("a program has a recording");
    };
    let is_one = parts.len() == 1;
    let may_follow = |(recording, options): &(&Recording, &ProgramOptions)| {
        recording.lanes() == 1 && !options.is_listed && options.unless.is_empty()
    };
    assert!(
        is_one || parts.iter().all(may_follow),
        "recordings in sequence have one lane, and run in all worlds"
    );
    let mut text = String::new();
    for (k, body) in bodies.iter().enumerate() {
        let mut printer = Printer {
            recording: &body.recording,
            expressions: Expressions {
                recording: &body.recording,
                single: body.recording.single_parts(),
                corrections: options.corrections,
            },
            text,
            indent: 1,
            exchange: options.exchange,
            is_shared: false,
        };
        let printed = match k {
            0 => printer.head(options, &bodies),
            _ => Ok(()),
        };
        printed
            .and_then(|()| match is_one {
                true => printer.body(body),
                false => printer.scope(body),
            })
            .expect("writing to a string does not fail");
        text = printer.text;
    }
    text.push_str("}\n");
    text
}

/// A recording as it is printed, and the fields of its inputs and outputs.
struct Body {
    recording: Recording,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
}

impl Body {
    fn new(recording: &Recording, options: &ProgramOptions) -> Body {
        let (inputs, outputs) = options.fields(recording);
        let recording = recording.vectorized();
        let goals = fields::written_early(&recording, &inputs, &outputs);
        Body {
            recording: recording.scheduled(&goals),
            inputs,
            outputs,
        }
    }
}

struct Printer<'a> {
    recording: &'a Recording,
    expressions: Expressions<'a>,
    text: String,
    indent: usize,
    exchange: Exchange,
    /// Inside a loop whose iterations are shared among lanes.
    is_shared: bool,
}

impl Printer<'_> {
    /// Everything before the first body.
    fn head(&mut self, options: &ProgramOptions, bodies: &[Body]) -> fmt::Result {
        writeln!(self.text, "override worlds: u32;")?;
        // a workgroup that is a world has as many threads; then no override may have the name of its memory
        let lanes = self.recording.lanes();
        let is_world = lanes > 1 && self.exchange == Exchange::Workgroup;
        let threads = match is_world {
            true => format!("{lanes}u"),
            false => {
                let threads = options.workgroup;
                writeln!(self.text, "override workgroup: u32 = {threads}u;")?;
                "workgroup".to_owned()
            }
        };
        writeln!(
            self.text,
            "@group(0) @binding(0) var<storage, read_write> fields: array<vec4<f32>>;"
        )?;
        if bodies.iter().any(|body| body.recording.scratch() > 0) {
            writeln!(
                self.text,
                "@group(0) @binding(1) var<storage, read_write> scratch: array<vec4<f32>>;"
            )?;
        }
        let tables = bodies.iter().map(|body| body.recording.reads_tables());
        let (numbers, indices) = tables.fold((false, false), |a, b| (a.0 | b.0, a.1 | b.1));
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
        if is_world {
            writeln!(self.text, "var<workgroup> exchange: array<f32, {lanes}>;")?;
        }
        writeln!(self.text, "{}", options.corrections.functions())?;
        writeln!(self.text, "@compute @workgroup_size({threads})")?;
        let shuffles = lanes > 1 && self.exchange == Exchange::Subgroup;
        let more = match shuffles {
            true => ", @builtin(subgroup_invocation_id) place: u32",
            false => "",
        };
        writeln!(
            self.text,
            "fn {}(@builtin(global_invocation_id) thread: vec3<u32>{more}) {{",
            options.entry
        )?;
        let place = match lanes {
            1 => "thread.x".to_owned(),
            lanes => format!("thread.x / {lanes}u"),
        };
        if options.is_listed {
            line!(self, "if ({place} >= left[3]) {{ return; }}")?;
            line!(self, "let world = list[{place}];")?;
        } else {
            line!(self, "let world = {place};")?;
            line!(self, "if (world >= worlds) {{ return; }}")?;
        }
        if lanes > 1 {
            line!(self, "let lane = thread.x % {lanes}u;")?;
        }
        if shuffles {
            line!(self, "let first_lane = place - lane;")?;
        }
        for field in &options.unless {
            let (quad, part) = place_of_field(*field);
            line!(
                self,
                "if (fields[{quad}u * worlds + world].{part} != 0.0f) {{ return; }}"
            )?;
        }
        Ok(())
    }

    /// A body whose names are its own.
    fn scope(&mut self, body: &Body) -> fmt::Result {
        line!(self, "{{")?;
        self.indent += 1;
        self.body(body)?;
        self.indent -= 1;
        line!(self, "}}")
    }

    fn body(&mut self, body: &Body) -> fmt::Result {
        let lanes = self.recording.lanes();
        let fields = Fields::new(self.recording, &body.inputs, &body.outputs);
        for (k, statement) in self.recording.body.iter().enumerate() {
            self.inputs(&fields, k)?;
            self.statement(statement)?;
            self.outputs(&fields, k + 1)?;
        }
        let end = self.recording.body.len() + 1;
        self.inputs(&fields, end)?;
        if lanes > 1 {
            self.barrier_before_stores()?;
            line!(self, "if (lane == 0u) {{")?;
            self.indent += 1;
        }
        self.outputs(&fields, end + 1)?;
        if lanes > 1 {
            self.indent -= 1;
            line!(self, "}}")?;
        }
        Ok(())
    }

    /// Writes the given components of a vector.
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
                if let (Op::Quad(quad), Some(part)) = (op, self.expressions.single.get(number)) {
                    let part = COMPONENTS[*part];
                    return line!(self, "let t{number} = {}.{part};", vector(&quad));
                }
                match op {
                    Op::FromLane(x, lane) => {
                        let lanes = self.recording.lanes();
                        let shuffle = format!("subgroupShuffle(VALUE, first_lane + {lane}u)")
                            .replace(" + 0u", "");
                        debug_assert!(lane < lanes, "a lane of the world");
                        self.of_lane(*number, x, &format!("{lane}u"), &shuffle)
                    }
                    Op::AcrossLanes(x, apart) => {
                        let shuffle = format!("subgroupShuffleXor(VALUE, {apart}u)");
                        self.of_lane(*number, x, &format!("lane ^ {apart}u"), &shuffle)
                    }
                    op => line!(self, "let t{number} = {};", self.expressions.op(op)),
                }
            }
            Statement::Var { name, value } => {
                line!(self, "var v{name} = {};", self.expressions.operand(*value))
            }
            Statement::Set { name, value } => {
                line!(self, "v{name} = {};", self.expressions.operand(*value))
            }
            Statement::Store { cell, value } => {
                let value = self.expressions.operand(*value);
                self.by_one_lane(|printer| line!(printer, "{} = {value};", scratch(cell)))
            }
            Statement::StoreQuad { quad, numbers } => {
                let numbers = numbers.map(|x| x.map(|x| self.expressions.operand(x)));
                self.by_one_lane(|printer| printer.write(&vector(quad), &numbers))
            }
            Statement::List { name, rows } => match rows.constant() {
                Some(rows) => line!(self, "var n{name} = {}u;", rows as u32),
                None => line!(
                    self,
                    "var n{name} = u32({});",
                    self.expressions.operand(*rows)
                ),
            },
            Statement::When { mask, body } => {
                line!(self, "if ({}) {{", self.expressions.operand(*mask))?;
                self.nested(body)
            }
            Statement::Push {
                list,
                capacity,
                row,
                mask,
                body,
            } => {
                line!(self, "if ({}) {{", self.expressions.operand(*mask))?;
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
                bounds,
                body,
            } => {
                let (first, end) = match *bounds {
                    Bounds::Shared { first, end } => {
                        return self.shared_loop(*i, (index(first), index(end)), body);
                    }
                    Bounds::Span { first, end } => (index(first), index(end)),
                    Bounds::Rows { list, capacity } => {
                        line!(self, "let end{i} = min(n{list}, {capacity}u);")?;
                        ("0u".to_owned(), format!("end{i}"))
                    }
                };
                line!(self, "for (var i{i} = {first}; i{i} < {end}; i{i}++) {{")?;
                self.nested(body)
            }
            Statement::Stop(mask) => line!(
                self,
                "if ({}) {{ break; }}",
                self.expressions.operand(*mask)
            ),
        }
    }

    /// A loop of which each lane runs its own iterations.
    fn shared_loop(
        &mut self,
        i: u32,
        (first, end): (String, String),
        body: &[Statement],
    ) -> fmt::Result {
        let lanes = self.recording.lanes();
        self.barrier_before_stores()?;
        line!(
            self,
            "for (var i{i} = {first} + lane; i{i} < {end}; i{i} += {lanes}u) {{"
        )?;
        self.is_shared = true;
        self.nested(body)?;
        self.is_shared = false;
        // another lane may read what this one wrote
        self.barrier()
    }

    /// A value of another lane. `place` is that lane's number.
    fn of_lane(&mut self, number: u32, x: Operand, place: &str, shuffle: &str) -> fmt::Result {
        let x = self.expressions.operand(x);
        match self.exchange {
            Exchange::Subgroup => line!(self, "let t{number} = {};", shuffle.replace("VALUE", &x)),
            Exchange::Workgroup => {
                line!(self, "exchange[lane] = {x};")?;
                line!(self, "workgroupBarrier();")?;
                line!(self, "let t{number} = exchange[{place}];")?;
                line!(self, "workgroupBarrier();")
            }
        }
    }

    /// Prints a store; outside of shared loops one lane does it.
    fn by_one_lane(&mut self, store: impl FnOnce(&mut Self) -> fmt::Result) -> fmt::Result {
        if self.recording.lanes() == 1 || self.is_shared {
            return store(self);
        }
        self.barrier_before_stores()?;
        line!(self, "if (lane == 0u) {{")?;
        self.indent += 1;
        store(self)?;
        self.indent -= 1;
        line!(self, "}}")?;
        self.barrier()
    }

    /// Lets all lanes read what one of them is about to change. Those of a subgroup are assumed to run the same statement at a time, where
    /// all are active: compilers keep them together.
    fn barrier_before_stores(&mut self) -> fmt::Result {
        match self.exchange {
            Exchange::Subgroup => Ok(()),
            Exchange::Workgroup => self.barrier(),
        }
    }

    /// Orders the accesses of the lanes of a world to memory.
    fn barrier(&mut self) -> fmt::Result {
        match self.exchange {
            Exchange::Subgroup => line!(self, "subgroupBarrier();"),
            Exchange::Workgroup => line!(self, "storageBarrier();"),
        }
    }
}
