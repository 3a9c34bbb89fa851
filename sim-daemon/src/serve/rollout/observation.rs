//! What a policy sees: terms over the fields of a frame, in the precision of the run, as tasks compute them in Python.

use std::ops::{Add, Mul, Sub};

use sim_protocol::{Dtype, Table};

use super::memory::Memory;
use super::question::{Asked, Columns, Function, Source, Term};

/// Values that a term may have.
const SIZE_MAX: usize = 1 << 20;

/// A number of the run.
pub(super) trait Real:
    bytemuck::Pod + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + PartialOrd
{
    const DTYPE: Dtype;
    fn new(value: f64) -> Self;
    fn double(self) -> f64;
    fn sin(self) -> Self;
    fn cos(self) -> Self;
}

impl Real for f32 {
    const DTYPE: Dtype = Dtype::F32;
    fn new(value: f64) -> f32 {
        value as f32
    }
    fn double(self) -> f64 {
        f64::from(self)
    }
    fn sin(self) -> f32 {
        libm::sinf(self)
    }
    fn cos(self) -> f32 {
        libm::cosf(self)
    }
}

impl Real for f64 {
    const DTYPE: Dtype = Dtype::F64;
    fn new(value: f64) -> f64 {
        value
    }
    fn double(self) -> f64 {
        self
    }
    fn sin(self) -> f64 {
        libm::sin(self)
    }
    fn cos(self) -> f64 {
        libm::cos(self)
    }
}

/// Columns in the arena of a frame.
struct Place<R> {
    /// First value of the field.
    start: usize,
    /// Values of a world.
    stride: usize,
    places: Vec<usize>,
    minus: Vec<R>,
    scale: Vec<R>,
}

impl<R: Real> Place<R> {
    fn find(columns: &Columns, term: Option<&Term>, table: &Table) -> Result<Place<R>, String> {
        let name = &columns.field;
        let row = table
            .row(name)
            .ok_or_else(|| format!("frames carry no `{name}`; add it to `fields` at launch"))?;
        if row.dtype != R::DTYPE {
            let dtype = row.dtype.numpy_name();
            return Err(format!(
                "`{name}` is {dtype}; a policy sees fields of real numbers"
            ));
        }
        let stride: usize = row.shape[1..].iter().product();
        if let Some(place) = columns.places.iter().find(|&&place| place >= stride) {
            return Err(format!(
                "`{name}` has {stride} columns, and no column {place}"
            ));
        }
        let numbers = |values: &[f64]| values.iter().map(|&value| R::new(value)).collect();
        Ok(Place {
            start: (row.offset - Table::head_bytes(table.rows().len())) / size_of::<R>(),
            stride,
            places: columns.places.clone(),
            minus: term.map_or(Vec::new(), |term| numbers(&term.minus)),
            scale: term.map_or(Vec::new(), |term| numbers(&term.scale)),
        })
    }

    /// The columns of a world, in `to`.
    fn read(&self, arena: &[R], world: usize, to: &mut Vec<R>) {
        let row = &arena[self.start + world * self.stride..][..self.stride];
        to.clear();
        to.extend(self.places.iter().map(|&place| row[place]));
    }

    fn shift(&self, values: &mut [R]) {
        for (value, &minus) in values.iter_mut().zip(&self.minus) {
            *value = *value - minus;
        }
        for (value, &scale) in values.iter_mut().zip(&self.scale) {
            *value = *value * scale;
        }
    }
}

/// A term that knows its place.
enum Bound<R> {
    Field {
        columns: Place<R>,
        turned_by: Option<Place<R>>,
        function: Option<Function>,
    },
    Gravity(Place<R>),
    Input(usize),
    LastAction,
    Clock {
        step: R,
        input: Option<usize>,
    },
}

/// All terms of a policy.
pub(super) struct Observation<R> {
    terms: Vec<Bound<R>>,
    /// Values of each, without history.
    sizes: Vec<usize>,
    values: Vec<R>,
    quaternion: Vec<R>,
}

impl<R: Real> Observation<R> {
    /// Finds the columns of all terms.
    ///
    /// # Errors
    /// One sentence about the first term that does not fit.
    pub(super) fn find(asked: &Asked, table: &Table) -> Result<Observation<R>, String> {
        let (mut terms, mut sizes, mut seen) = (Vec::new(), Vec::new(), 0usize);
        let is_input = |input: &usize| *input < asked.inputs.len();
        for (index, term) in asked.question.terms.iter().enumerate() {
            let wrong = |problem: String| format!("observation term {index}: {problem}");
            let (bound, size) = match &term.source {
                Source::Field {
                    columns,
                    turned_by,
                    function,
                } => {
                    let quaternion = turned_by.as_ref().map(|q| quaternion(q, table)).transpose();
                    let bound = Bound::Field {
                        columns: Place::find(columns, Some(term), table).map_err(wrong)?,
                        turned_by: quaternion.map_err(wrong)?,
                        function: *function,
                    };
                    if turned_by.is_some() && !columns.places.len().is_multiple_of(3) {
                        let count = columns.places.len();
                        return Err(wrong(format!("{count} columns are no vectors of 3")));
                    }
                    (bound, columns.places.len())
                }
                Source::Gravity(columns) => (
                    Bound::Gravity(quaternion(columns, table).map_err(wrong)?),
                    3,
                ),
                Source::Input(input) if is_input(input) => {
                    (Bound::Input(*input), asked.question.inputs[*input].columns)
                }
                Source::Clock { step, input } if input.as_ref().is_none_or(is_input) => {
                    let step = R::new(*step);
                    (
                        Bound::Clock {
                            step,
                            input: *input,
                        },
                        2,
                    )
                }
                Source::LastAction => (Bound::LastAction, asked.network.outputs()),
                Source::Input(_) | Source::Clock { .. } => {
                    return Err(wrong("there is no such input".to_owned()));
                }
            };
            let width = size.checked_mul(term.history);
            let Some(width) = width.filter(|width| (1..=SIZE_MAX).contains(width)) else {
                let history = term.history;
                return Err(wrong(format!(
                    "{size} values × {history}; give 1 to {SIZE_MAX}"
                )));
            };
            let fits = |length: usize| length == 0 || length == size;
            let clips = term.clip.iter().flatten();
            if !fits(term.minus.len())
                || !fits(term.scale.len())
                || clips.clone().any(|ends| ends.len() != size)
            {
                return Err(wrong(format!("its numbers are not for {size} values")));
            }
            check_clip(&term.clip).map_err(wrong)?;
            terms.push(bound);
            sizes.push(size);
            seen += width;
        }
        let wanted = asked.network.inputs();
        if seen != wanted {
            return Err(format!(
                "the observation has {seen} values, and the policy takes {wanted}; give the terms that it was trained with"
            ));
        }
        Ok(Observation {
            terms,
            sizes,
            values: Vec::new(),
            quaternion: Vec::new(),
        })
    }

    /// Values of each term, without history.
    pub(super) fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Writes what the policy sees of a world before a frame.
    pub(super) fn write(
        &mut self,
        asked: &Asked,
        memory: &mut Memory,
        arena: &[R],
        (frame, world): (usize, usize),
        to: &mut [f32],
    ) {
        let mut kept = memory.world(world);
        let has_begun = kept.has_begun();
        let input =
            |input: usize| asked.question.inputs[input].row(&asked.inputs[input], frame, world);
        let mut rest = to;
        let values = &mut self.values;
        for (index, (bound, term)) in self.terms.iter().zip(&asked.question.terms).enumerate() {
            let mut clocks = 0;
            match bound {
                Bound::Field {
                    columns,
                    turned_by,
                    function,
                } => {
                    columns.read(arena, world, values);
                    if let Some(turned_by) = turned_by {
                        turned_by.read(arena, world, &mut self.quaternion);
                        for vector in values.as_chunks_mut::<3>().0 {
                            *vector = rotate_inverse(&self.quaternion, *vector);
                        }
                    }
                    columns.shift(values);
                    match function {
                        Some(Function::Sin) => values.iter_mut().for_each(|x| *x = x.sin()),
                        Some(Function::Cos) => values.iter_mut().for_each(|x| *x = x.cos()),
                        None => {}
                    }
                }
                Bound::Gravity(columns) => {
                    columns.read(arena, world, &mut self.quaternion);
                    values.clear();
                    values.extend(projected_gravity(&self.quaternion));
                }
                Bound::Input(place) => {
                    values.clear();
                    values.extend(input(*place).iter().map(|&value| R::new(value)));
                }
                Bound::LastAction => {
                    values.clear();
                    values.extend(kept.last_action().iter().map(|&value| R::new(value)));
                }
                Bound::Clock { step, input: gate } => {
                    clocks = 1;
                    let runs =
                        gate.is_none_or(|gate| input(gate).iter().any(|&value| value != 0.0));
                    let phase = match runs {
                        true => R::new(*kept.phase(index)),
                        false => R::new(0.0),
                    };
                    *kept.phase(index) = (phase + *step).double();
                    values.clear();
                    values.extend([phase.sin(), phase.cos()]);
                }
            }
            if !matches!(bound, Bound::Field { .. }) {
                scale(term, values);
            }
            let (own_part, after) = rest.split_at_mut(values.len() * term.history);
            rest = after;
            let (before, now) = own_part.split_at_mut(own_part.len() - values.len());
            for (to, value) in now.iter_mut().zip(&*values) {
                *to = value.double() as f32;
            }
            if let Some([low, high]) = &term.clip {
                for ((value, &low), &high) in now.iter_mut().zip(low).zip(high) {
                    *value = value.clamp(low, high);
                }
            }
            let history = kept.history(index, clocks, before.len());
            if !has_begun {
                for past in history.chunks_exact_mut(now.len()) {
                    past.iter_mut()
                        .zip(&*now)
                        .for_each(|(past, &now)| *past = f64::from(now));
                }
            }
            before
                .iter_mut()
                .zip(&*history)
                .for_each(|(to, &past)| *to = past as f32);
            if !history.is_empty() {
                history.copy_within(now.len().., 0);
                let last = history.len() - now.len();
                history[last..]
                    .iter_mut()
                    .zip(&*now)
                    .for_each(|(past, &now)| *past = f64::from(now));
            }
        }
        kept.begin();
    }
}

/// Refuses bounds without a number between them.
pub(super) fn check_clip(clip: &Option<[Vec<f32>; 2]>) -> Result<(), String> {
    let Some([low, high]) = clip else {
        return Ok(());
    };
    let is_wrong = |(low, high): &(&f32, &f32)| low.is_nan() || high.is_nan() || low > high;
    match low.iter().zip(high).find(is_wrong) {
        Some((low, high)) => Err(format!(
            "clip [{low}, {high}] is empty; give low below high"
        )),
        None => Ok(()),
    }
}

/// `scale * (values - minus)`
fn scale<R: Real>(term: &Term, values: &mut [R]) {
    for (value, &minus) in values.iter_mut().zip(&term.minus) {
        *value = *value - R::new(minus);
    }
    for (value, &scale) in values.iter_mut().zip(&term.scale) {
        *value = *value * R::new(scale);
    }
}

fn quaternion<R: Real>(columns: &Columns, table: &Table) -> Result<Place<R>, String> {
    if columns.places.len() != 4 {
        let count = columns.places.len();
        return Err(format!(
            "{count} columns of `{}` are no quaternion",
            columns.field
        ));
    }
    Place::find(columns, None, table)
}

/// A vector in the axes of a body, by its quaternion (x, y, z, w): v (w² - |u|²) + 2 u (u·v) - 2 w (u × v).
fn rotate_inverse<R: Real>(quaternion: &[R], [a, b, c]: [R; 3]) -> [R; 3] {
    let &[x, y, z, w] = quaternion else {
        return [a, b, c];
    };
    let two = R::new(2.0);
    let along = two * (x * a + y * b + z * c);
    let scale = w * w - x * x - y * y - z * z;
    let double = two * w;
    [
        scale * a + along * x - double * (y * c - z * b),
        scale * b + along * y - double * (z * a - x * c),
        scale * c + along * z - double * (x * b - y * a),
    ]
}

/// The direction of gravity in the axes of a body, by its quaternion.
fn projected_gravity<R: Real>(quaternion: &[R]) -> [R; 3] {
    let &[x, y, z, w] = quaternion else {
        return [R::new(0.0); 3];
    };
    let two = R::new(2.0);
    [
        two * (w * y - x * z),
        R::new(-2.0) * (w * x + y * z),
        two * (x * x + y * y) - R::new(1.0),
    ]
}
