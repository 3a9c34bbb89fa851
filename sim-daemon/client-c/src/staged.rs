//! Inputs that were set and wait for the next step.

use sim_protocol::{Command, Description, InputInfo, ProtocolError, Values};

/// Inputs of a step that need no allocation; more are allowed.
const FEW: usize = 8;

/// A value for each input of a step, or none.
#[derive(Debug)]
pub(crate) struct Staged {
    inputs: Vec<Input>,
    /// Another set of them, unset, for when the first is on its way.
    spare: Option<Vec<Input>>,
    worlds: usize,
}

/// Inputs on their way.
#[derive(Debug)]
pub(crate) struct Taken(Vec<Input>);

#[derive(Debug)]
struct Input {
    name: String,
    columns: usize,
    is: Is,
    // both stay, so that their memory is taken once
    single: Vec<f32>,
    double: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Is {
    Unset,
    Single,
    Double,
}

impl Staged {
    pub(crate) fn new(description: &Description) -> Staged {
        let input = |info: &InputInfo| Input {
            name: info.name.clone(),
            columns: info.columns,
            is: Is::Unset,
            single: Vec::new(),
            double: Vec::new(),
        };
        Staged {
            inputs: description.commands.iter().map(input).collect(),
            spare: None,
            worlds: description.worlds,
        }
    }

    /// Keeps a copy of the values of an input, `(worlds, columns)`, in place of those set before.
    pub(crate) fn set(&mut self, name: &str, values: Values<'_>) -> Result<(), ProtocolError> {
        let worlds = self.worlds;
        let Some(input) = self.inputs.iter_mut().find(|input| input.name == name) else {
            let known: Vec<&str> = self.inputs.iter().map(|input| &*input.name).collect();
            return Err(ProtocolError::NotAnInput {
                field: name.to_owned(),
                verb: "commanded",
                known: known.join(", "),
            });
        };
        let columns = input.columns;
        if values.len() != worlds * columns {
            return Err(ProtocolError::Shape {
                field: name.to_owned(),
                expected: format!(
                    "{worlds} worlds x {columns} columns = {} entries",
                    worlds * columns
                ),
                got: values.len().to_string(),
            });
        }
        match values {
            Values::F32(values) => {
                input.single.clear();
                input.single.extend_from_slice(values);
                input.is = Is::Single;
            }
            Values::F64(values) => {
                input.double.clear();
                input.double.extend_from_slice(values);
                input.is = Is::Double;
            }
        }
        Ok(())
    }

    /// Hands over what was set, and unsets it, whatever becomes of it. Others may be set meanwhile.
    pub(crate) fn take(&mut self) -> Taken {
        let empty = |inputs: &[Input]| inputs.iter().map(Input::empty).collect();
        let next = self.spare.take().unwrap_or_else(|| empty(&self.inputs));
        Taken(std::mem::replace(&mut self.inputs, next))
    }

    /// Takes back the memory of what was sent.
    pub(crate) fn give_back(&mut self, mut taken: Taken) {
        for input in &mut taken.0 {
            input.is = Is::Unset;
        }
        self.spare = Some(taken.0);
    }
}

impl Taken {
    /// Sends what was set.
    pub(crate) fn send<R>(&self, send: impl FnOnce(&[Command<'_>]) -> R) -> R {
        let count = self.0.iter().filter(|input| input.is != Is::Unset).count();
        let mut set = self.0.iter().filter_map(Input::command);
        if count <= FEW {
            let few: [Command<'_>; FEW] = std::array::from_fn(|_| set.next().unwrap_or(NONE));
            send(&few[..count])
        } else {
            send(&set.collect::<Vec<_>>())
        }
    }
}

const NONE: Command<'static> = Command {
    field: "",
    columns: 0..0,
    values: Values::F32(&[]),
};

impl Input {
    fn empty(&self) -> Input {
        Input {
            name: self.name.clone(),
            columns: self.columns,
            is: Is::Unset,
            single: Vec::new(),
            double: Vec::new(),
        }
    }

    fn command(&self) -> Option<Command<'_>> {
        let values = match self.is {
            Is::Unset => return None,
            Is::Single => Values::F32(&self.single),
            Is::Double => Values::F64(&self.double),
        };
        Some(Command {
            field: &self.name,
            columns: 0..self.columns,
            values,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn staged(inputs: usize) -> Staged {
        let input = |number| Input {
            name: format!("input{number}"),
            columns: 2,
            is: Is::Unset,
            single: Vec::new(),
            double: Vec::new(),
        };
        Staged {
            inputs: (0..inputs).map(input).collect(),
            spare: None,
            worlds: 3,
        }
    }

    fn sent(staged: &mut Staged) -> Vec<(String, usize)> {
        let names = |commands: &[Command<'_>]| {
            let name = |command: &Command<'_>| (command.field.to_owned(), command.values.len());
            commands.iter().map(name).collect()
        };
        let taken = staged.take();
        let sent = taken.send(names);
        staged.give_back(taken);
        sent
    }

    #[test]
    fn what_is_set_while_a_step_is_on_its_way_is_for_the_next_one() {
        let mut staged = staged(2);
        staged.set("input0", Values::F32(&[1.0; 6])).unwrap();
        let taken = staged.take();
        staged.set("input1", Values::F64(&[2.0; 6])).unwrap();
        let names = |commands: &[Command<'_>]| {
            let names = commands.iter().map(|command| command.field.to_owned());
            names.collect::<Vec<_>>()
        };
        assert_eq!(taken.send(names), ["input0"]);
        staged.give_back(taken);
        assert_eq!(sent(&mut staged), [("input1".to_owned(), 6)]);
        assert_eq!(sent(&mut staged), []);
    }

    #[test]
    fn what_was_set_is_sent_once() {
        // more inputs than fit without an allocation
        for inputs in [1, FEW, FEW + 1, 3 * FEW] {
            let mut staged = staged(inputs);
            let mut all = Vec::new();
            for number in 0..inputs {
                let name = format!("input{number}");
                staged.set(&name, Values::F32(&[1.0; 6])).unwrap();
                staged.set(&name, Values::F64(&[2.0; 6])).unwrap();
                all.push((name, 6));
            }
            assert_eq!(sent(&mut staged), all);
            assert_eq!(sent(&mut staged), []);
        }
    }

    #[test]
    fn unknown_names_and_wrong_counts_are_refused_and_change_nothing() {
        let mut staged = staged(2);
        staged.set("input1", Values::F32(&[1.0; 6])).unwrap();
        let unknown = staged.set("input7", Values::F32(&[1.0; 6])).unwrap_err();
        assert!(unknown.to_string().contains("input0, input1"), "{unknown}");
        let wrong = staged.set("input1", Values::F64(&[1.0; 5])).unwrap_err();
        let sentence = "input1: expected 3 worlds x 2 columns = 6 entries, got 5";
        assert_eq!(wrong.to_string(), sentence);
        assert_eq!(sent(&mut staged), [("input1".to_owned(), 6)]);
    }
}
