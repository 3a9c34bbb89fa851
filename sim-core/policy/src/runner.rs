//! Runs a network for rows of inputs, on several threads where that is worth it.

use crate::kernel::{Compiled, Plan, Rows, compiled};
use crate::{Network, PolicyError};

/// Multiplications below which a further thread takes longer to start than to help: about half a millisecond.
const PER_THREAD: usize = 8 << 20;

/// A network that is ready to run.
#[derive(Debug)]
pub struct Runner {
    plan: Plan,
    inputs: usize,
    outputs: usize,
    /// Multiplications of a row.
    work: usize,
    compiled: Compiled,
    /// Of each thread.
    scratch: Vec<Vec<f32>>,
}

impl Runner {
    /// Makes a network ready.
    pub fn new(network: &Network) -> Runner {
        Runner {
            plan: Plan::new(network),
            inputs: network.inputs(),
            outputs: network.outputs(),
            work: network.parameters().len().max(1),
            compiled: compiled(),
            scratch: Vec::new(),
        }
    }

    /// Evaluates rows of inputs, `(rows, inputs)`, into `(rows, outputs)`, on up to `threads` threads. Their number changes
    /// no bit.
    ///
    /// # Errors
    /// [`PolicyError::Layer`] where the arrays have other sizes.
    pub fn run(
        &mut self,
        inputs: &[f32],
        outputs: &mut [f32],
        threads: usize,
    ) -> Result<(), PolicyError> {
        let rows = inputs.len() / self.inputs;
        if inputs.len() != rows * self.inputs || outputs.len() != rows * self.outputs {
            return Err(PolicyError::Layer {
                layer: 0,
                problem: format!(
                    "takes rows of {} and gives rows of {} values; the arrays have {} and {}",
                    self.inputs,
                    self.outputs,
                    inputs.len(),
                    outputs.len()
                ),
            });
        }
        if rows == 0 {
            return Ok(());
        }
        let worth = rows.saturating_mul(self.work) / PER_THREAD;
        let threads = worth.clamp(1, threads.max(1)).min(rows);
        let memory = self.plan.scratch();
        self.scratch.resize_with(threads, || vec![0.0; memory]);
        let (plan, compiled) = (&self.plan, self.compiled);
        let (width, height, share) = (self.inputs, self.outputs, rows.div_ceil(threads));
        let parts = inputs
            .chunks(share * width)
            .zip(outputs.chunks_mut(share * height));
        let mut parts = parts
            .zip(&mut self.scratch)
            .map(|((inputs, outputs), scratch)| Rows {
                inputs,
                outputs,
                scratch,
            });
        let first = parts.next();
        std::thread::scope(|scope| {
            for mut rows in parts {
                scope.spawn(move || compiled(plan, width, height, &mut rows));
            }
            if let Some(mut rows) = first {
                compiled(plan, width, height, &mut rows);
            }
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layer;
    use crate::kernel::portable;

    /// Numbers without a pattern, in [-1, 1).
    fn numbers(count: usize, seed: u64) -> Vec<f32> {
        let mut state = seed;
        let next = |_| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        (0..count).map(next).collect()
    }

    fn network() -> Network {
        let layers = vec![
            Layer::Subtract,
            Layer::Clip {
                low: -0.9,
                high: 0.9,
            },
            Layer::Linear {
                inputs: 19,
                outputs: 37,
            },
            Layer::Elu {
                alpha: 1.0,
                scale: 1.0,
            },
            Layer::Linear {
                inputs: 37,
                outputs: 5,
            },
            Layer::Tanh,
        ];
        Network::new(19, layers, numbers(19 + 20 * 37 + 38 * 5, 1)).unwrap()
    }

    fn run(network: &Network, inputs: &[f32], threads: usize) -> Vec<u32> {
        let mut outputs = vec![0.0; inputs.len() / network.inputs() * network.outputs()];
        let mut runner = Runner::new(network);
        runner.work = PER_THREAD; // so that every row is worth a thread
        runner.run(inputs, &mut outputs, threads).unwrap();
        outputs.into_iter().map(f32::to_bits).collect()
    }

    #[test]
    fn bits_depend_on_neither_rows_nor_threads_nor_instructions() {
        let network = network();
        let inputs = numbers(19 * 23, 2);
        let all = run(&network, &inputs, 1);
        for threads in [2, 3, 8, 64] {
            assert_eq!(run(&network, &inputs, threads), all);
        }
        for (row, wanted) in inputs.chunks(19).zip(all.chunks(5)) {
            assert_eq!(run(&network, row, 1), wanted);
        }
        let plan = Plan::new(&network);
        let mut outputs = vec![0.0; 23 * 5];
        let mut rows = Rows {
            inputs: &inputs,
            outputs: &mut outputs,
            scratch: &mut vec![0.0; plan.scratch()],
        };
        portable(&plan, 19, 5, &mut rows);
        let bits: Vec<u32> = outputs.into_iter().map(f32::to_bits).collect();
        assert_eq!(bits, all);
    }

    #[test]
    fn rows_equal_the_sums_in_double_precision() {
        let network = network();
        let inputs = numbers(19, 3);
        let mut row: Vec<f64> = inputs.iter().map(|&x| f64::from(x)).collect();
        for (layer, parameters) in network.with_parameters() {
            let at = |place: usize| f64::from(parameters[place]);
            row = match layer {
                Layer::Subtract => (0..19).map(|i| row[i] - at(i)).collect(),
                Layer::Clip { .. } => row.iter().map(|x| x.clamp(-0.9, 0.9)).collect(),
                Layer::Elu { .. } => row
                    .iter()
                    .map(|&x| if x > 0.0 { x } else { x.exp_m1() })
                    .collect(),
                Layer::Linear { inputs, outputs } => (0..outputs)
                    .map(|o| {
                        let sum = |sum, i| sum + at(o * inputs + i) * row[i];
                        (0..inputs).fold(at(inputs * outputs + o), sum)
                    })
                    .collect(),
                _ => row.iter().map(|x| x.tanh()).collect(),
            };
        }
        let made = run(&network, &inputs, 1);
        for (made, wanted) in made.into_iter().zip(row) {
            // 38 roundings of sums of at most 38, once more through the second layer
            let tolerance = 38.0 * 38.0 * f64::from(f32::EPSILON);
            assert!((f64::from(f32::from_bits(made)) - wanted).abs() < tolerance);
        }
    }

    #[test]
    fn arrays_of_other_sizes_are_refused() {
        let mut runner = Runner::new(&network());
        let refused = runner.run(&[0.0; 20], &mut [0.0; 5], 1).unwrap_err();
        assert!(refused.to_string().contains("rows of 19"), "{refused}");
        runner.run(&[], &mut [], 4).unwrap();
    }
}
