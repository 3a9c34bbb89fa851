//! From a recording, which a world runs by itself, to linear code, which all worlds of a block run together.
//!
//! A branch of a recording becomes instructions that are jumped over if it is for no world of a block. Values are computed in all
//! worlds, and variables assigned where a world is active. A loop goes on while any world is in it.

mod emit;
mod operands;
mod operations;

use crate::address::{Address, Places};
use crate::code::{Code, Instruction, Kind, Label, Logic, Operand, Place};
use crate::error::CompileError;
use sim_physics::lane::Tables;
use sim_record::Recording;
use sim_record::ir::tree::{self, Bounds, Cell, Row, Statement};
use std::collections::HashMap;

/// Translates a recording whose inputs, outputs and scratch memory have these places.
pub(crate) fn lower(
    recording: &Recording,
    places: &Places<'_>,
    tables: &Tables<f32>,
) -> Result<Code, CompileError> {
    let mut lowering = Lowering {
        recording,
        tables,
        places: *places,
        code: Code::default(),
        values: vec![None; recording.values()],
        read: HashMap::new(),
        constants: HashMap::new(),
        refuses: false,
        source: None,
        variables: HashMap::new(),
    };
    lowering.body(recording.body(), &mut Active::default())?;
    lowering.refuse_if_assumed_wrongly()?;
    lowering.write(places.outputs)?;
    Ok(lowering.code)
}

/// Which worlds run a statement.
#[derive(Clone, Copy, Default)]
struct Active {
    /// None for all of them.
    mask: Option<u32>,
    /// What holds the mask of the innermost loop, if worlds leave it, and where it ends.
    innermost: Option<(u32, Label)>,
}

struct Lowering<'a> {
    recording: &'a Recording,
    tables: &'a Tables<f32>,
    places: Places<'a>,
    code: Code,
    /// By number in the recording.
    values: Vec<Option<Operand>>,
    /// Values that stand in the caller's arrays, by input.
    read: HashMap<u32, u32>,
    /// Values that are constants, by their bits.
    constants: HashMap<u32, u32>,
    /// The value of the recording that is computed, or was last.
    source: Option<u32>,
    /// Whether the end for what was assumed wrongly has been added.
    refuses: bool,
    /// By name: the variable, and the mask of the worlds for which it began.
    variables: HashMap<u32, (u32, Option<u32>)>,
}

impl Lowering<'_> {
    fn body(&mut self, body: &[Statement], active: &mut Active) -> Result<(), CompileError> {
        for statement in body {
            self.statement(statement, active)?;
        }
        Ok(())
    }

    fn statement(
        &mut self,
        statement: &Statement,
        active: &mut Active,
    ) -> Result<(), CompileError> {
        match statement {
            Statement::Let(number) => self.compute(*number)?,
            Statement::Var { name, value } => {
                let x = self.scalar(*value)?;
                let variable = self.variable();
                self.variables.insert(*name, (variable, active.mask));
                self.emit(Instruction::Store {
                    to: Place::Variable(variable),
                    x,
                });
            }
            Statement::Set { name, value } => self.set(*name, *value, *active)?,
            Statement::Store { cell, value } => self.store(cell, *value, *active)?,
            Statement::When { mask, body } => {
                let mask = self.mask(*mask)?;
                let inside = match active.mask {
                    None => mask,
                    Some(outside) => self.logic(Logic::And, outside, mask),
                };
                let label = self.label();
                self.emit(Instruction::JumpIfNone {
                    mask: inside,
                    label,
                });
                let mut inner = Active {
                    mask: Some(inside),
                    ..*active
                };
                self.body(body, &mut inner)?;
                self.emit(Instruction::Label(label));
            }
            Statement::Loop {
                bounds:
                    Bounds::Span {
                        first: Row::At(0),
                        end: Row::At(times),
                    },
                body,
                ..
            } => self.repeat(*times as u32, body, *active)?,
            Statement::Stop(mask) => {
                let (variable, exit) = active.innermost.expect("a stop stands in a loop");
                let mask = self.mask(*mask)?;
                let inside = active.mask.expect("worlds leave the loop");
                let left = self.logic(Logic::NotAnd, mask, inside);
                self.emit(Instruction::Store {
                    to: Place::Variable(variable),
                    x: Operand::Value(left),
                });
                self.emit(Instruction::JumpIfNone {
                    mask: left,
                    label: exit,
                });
                active.mask = Some(left);
            }
            other => return Err(CompileError::unknown(other)),
        }
        Ok(())
    }

    fn repeat(
        &mut self,
        times: u32,
        body: &[Statement],
        active: Active,
    ) -> Result<(), CompileError> {
        let (number, exit) = (self.code.loops, self.label());
        self.code.loops += 1;
        let mut inner = Active {
            mask: active.mask,
            innermost: None,
        };
        let leaves = body.iter().any(|s| matches!(s, Statement::Stop(_)));
        if leaves {
            let all = match active.mask {
                Some(mask) => mask,
                None => {
                    let to = self.code.value(Kind::Mask, None);
                    self.emit(Instruction::Everywhere { to });
                    to
                }
            };
            let variable = self.variable();
            self.emit(Instruction::Store {
                to: Place::Variable(variable),
                x: Operand::Value(all),
            });
            inner.innermost = Some((variable, exit));
        }
        self.emit(Instruction::LoopStart { number });
        if let Some((variable, _)) = inner.innermost {
            let to = self.code.value(Kind::Mask, None);
            self.emit(Instruction::Load {
                to,
                from: Place::Variable(variable),
            });
            inner.mask = Some(to);
        }
        self.body(body, &mut inner)?;
        self.emit(Instruction::LoopEnd {
            number,
            times,
            exit,
        });
        self.emit(Instruction::Label(exit));
        Ok(())
    }

    fn set(&mut self, name: u32, value: tree::Operand, active: Active) -> Result<(), CompileError> {
        let x = self.scalar(value)?;
        let (variable, began) = self.variables[&name];
        let place = Place::Variable(variable);
        match active.mask {
            // worlds for which it did not begin never read it
            Some(mask) if active.mask != began => self.store_where(mask, place, x),
            _ => self.emit(Instruction::Store { to: place, x }),
        }
        Ok(())
    }

    fn store(
        &mut self,
        cell: &Cell,
        value: tree::Operand,
        active: Active,
    ) -> Result<(), CompileError> {
        // the program may still refuse, and must not have written then
        if self.recording.assumed().is_some() && !self.refuses {
            return Err(CompileError::unknown(cell));
        }
        let x = self.scalar(value)?;
        let to = self.cell(cell)?;
        match active.mask {
            Some(mask) => self.store_where(mask, to, x),
            None => self.emit(Instruction::Store { to, x }),
        }
        Ok(())
    }

    /// Ends the program where what was assumed to hold nowhere holds: as soon as that is known, and before outputs are written.
    fn refuse_if_assumed_wrongly(&mut self) -> Result<(), CompileError> {
        if let (Some(assumed), false) = (self.recording.assumed(), self.refuses) {
            let mask = self.mask(assumed)?;
            self.emit(Instruction::RefuseIfAny { mask });
            self.refuses = true;
        }
        Ok(())
    }

    /// The outputs, after all has been computed.
    fn write(&mut self, outputs: &[Address]) -> Result<(), CompileError> {
        self.source = None;
        let mut stores = Vec::new();
        for (x, to) in self.recording.results().to_vec().iter().zip(outputs) {
            let mut x = self.scalar(*x)?;
            let home = match x {
                Operand::Value(value) => self.code.homes[value as usize],
                Operand::Constant(_) => None,
            };
            match home {
                Some(home) if home == Place::from(*to) => continue,
                // another output may go where it stands
                Some(home) => x = self.load(home),
                None => {}
            }
            stores.push(Instruction::Store {
                to: Place::from(*to),
                x,
            });
        }
        for store in stores {
            self.emit(store);
        }
        Ok(())
    }
}
