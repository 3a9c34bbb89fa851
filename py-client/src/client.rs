//! A client of one daemon, as Python holds it: steps without the interpreter lock, and listens to Ctrl-C meanwhile.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_protocol::device_memory::into_number;
use sim_protocol::{
    AttachOptions, Client as Connection, Description, Hook, OnDevice, ProtocolError,
};

use crate::advice::Advice;
use crate::errors::{protocol, raise};
use crate::frame::PyFrame;
use crate::input::{InputTable, Mask, Place, Seeds};
use crate::xla::{self, Line};

/// Names, columns, columns of each name, parts of the robots.
type Layout = (Vec<String>, usize, usize, Option<Vec<Place>>);

/// A connection to a daemon. `tightloop.Sim` wraps it, and documents its methods.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Client {
    description: Arc<Description>,
    // None once closed; a step that runs in another thread keeps its own reference until it returns
    connection: Arc<Line>,
    process: u32,
    table: InputTable,
    advice: Advice,
    /// `tightloop.gpu.card.Card`, once frames and commands stay on the GPU.
    card: Mutex<Option<Py<PyAny>>>,
}

#[pymethods]
impl Client {
    /// Attach to a daemon, and become its controller if ``lease`` is true (otherwise the first command does).
    #[new]
    #[pyo3(signature = (name, *, lease))]
    fn new(py: Python<'_>, name: &str, lease: bool) -> PyResult<Client> {
        let connection = waiting(py, |hook| {
            let connection = Connection::attach(name, &AttachOptions::default(), hook)?;
            if lease {
                connection.acquire(hook)?;
            }
            Ok(connection)
        })
        .map_err(|failure| failure.raised(py))?;
        Ok(Client {
            description: Arc::clone(connection.description()),
            table: InputTable::new(connection.description()),
            advice: Advice::new(connection.description()),
            connection: Line::new(connection),
            process: std::process::id(),
            card: Mutex::default(),
        })
    }

    /// Device memory of the daemon as JSON, and its file descriptors, which are the caller's to close.
    fn device_memory(&self, py: Python<'_>) -> PyResult<(String, Vec<i32>)> {
        let connection = self.connection(py)?;
        let (memory, descriptors) = self.waiting(py, |hook| connection.device_memory(hook))?;
        let memory = serde_json::to_string(&memory).expect("it is plain data");
        let descriptors = descriptors.into_iter().map(into_number);
        Ok((memory, descriptors.collect()))
    }

    /// Wait until the daemon reads no commands of an earlier step.
    fn land(&self, py: Python<'_>) -> PyResult<()> {
        let connection = self.connection(py)?;
        self.waiting(py, |hook| connection.land(hook))
    }

    /// Frames from now on are on this `tightloop.gpu.card.Card` too.
    fn keep_on(&self, card: Py<PyAny>) {
        *self.card.lock().unwrap_or_else(PoisonError::into_inner) = Some(card);
    }

    /// What the daemon tells about itself, as JSON.
    fn describe(&self) -> String {
        serde_json::to_string(&*self.description).expect("a description is plain data")
    }

    /// How frames kept their pace, as JSON; with ``clear`` it is counted anew.
    fn timing(&self, py: Python<'_>, clear: bool) -> PyResult<String> {
        let connection = self.connection(py)?;
        let timing = self.waiting(py, |hook| connection.timing(clear, hook))?;
        Ok(serde_json::to_string(&timing).expect("it is plain data"))
    }

    /// What the columns of an input are of: names, the number of columns, how many each name has, and the parts of the
    /// robots, if it comes by robot. None if the scene does not have it.
    fn layout(&self, name: &str) -> Option<Layout> {
        let row = self.table.row(name)?;
        Some((
            row.names.clone(),
            row.columns,
            row.parts,
            row.robots.clone(),
        ))
    }

    fn step(
        &self,
        py: Python<'_>,
        given: &Bound<'_, PyDict>,
        on_device: Option<(u64, u64)>,
    ) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        let inputs = self.table.take(given)?;
        let commands = inputs.commands()?;
        self.advice.step(py, &self.description, &commands)?;
        let frame = self.waiting(py, |hook| match on_device {
            None => connection.step(&commands, hook),
            Some(left) => connection.step_on_device(&commands, as_left(left), hook),
        })?;
        self.advised(py, frame)
    }

    fn send(
        &self,
        py: Python<'_>,
        given: &Bound<'_, PyDict>,
        on_device: Option<(u64, u64)>,
    ) -> PyResult<()> {
        let connection = self.connection(py)?;
        let inputs = self.table.take(given)?;
        let commands = inputs.commands()?;
        self.advice.step(py, &self.description, &commands)?;
        self.waiting(py, |hook| match on_device {
            None => connection.send(&commands, hook),
            Some(left) => connection.send_on_device(&commands, as_left(left), hook),
        })
    }

    fn recv(&self, py: Python<'_>) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        let frame = self.waiting(py, |hook| connection.recv(hook))?;
        self.advised(py, frame)
    }

    fn write(
        &self,
        py: Python<'_>,
        given: &Bound<'_, PyDict>,
        mask: Mask<'_>,
        is_known: bool,
    ) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        let inputs = self.table.take(given)?;
        let commands = inputs.commands()?;
        let mask = mask.as_ref().map(|mask| mask.as_slice()).transpose()?;
        // a keyframe's values are those of its model
        if !is_known {
            self.advice.write(py, &self.description, &commands, mask)?;
        }
        self.frame(py, |hook| connection.write(&commands, mask, hook))
    }

    fn reset(
        &self,
        py: Python<'_>,
        given: &Bound<'_, PyDict>,
        mask: Mask<'_>,
        seeds: Seeds<'_>,
    ) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        let inputs = self.table.take(given)?;
        let states = inputs.commands()?;
        let mask = mask.as_ref().map(|mask| mask.as_slice()).transpose()?;
        let seeds = seeds.as_ref().map(|seeds| seeds.as_slice()).transpose()?;
        if !states.is_empty() {
            self.advice.write(py, &self.description, &states, mask)?;
        }
        self.frame(py, |hook| connection.reset_to(&states, mask, seeds, hook))
    }

    fn forward(&self, py: Python<'_>) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        self.frame(py, |hook| connection.forward(hook))
    }

    fn snapshot(&self, py: Python<'_>, path: &str) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        self.frame(py, |hook| connection.snapshot(path, hook))
    }

    fn ik(&self, py: Python<'_>, path: &str) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        self.frame(py, |hook| connection.ik(path, hook))
    }

    fn rollout(&self, py: Python<'_>, path: &str) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        self.frame(py, |hook| connection.rollout(path, hook))
    }

    fn restore(
        &self,
        py: Python<'_>,
        path: &str,
        mask: Mask<'_>,
        from_world: Option<u64>,
    ) -> PyResult<PyFrame> {
        let connection = self.connection(py)?;
        let mask = mask.as_ref().map(|mask| mask.as_slice()).transpose()?;
        self.frame(py, |hook| connection.restore(path, mask, from_world, hook))
    }

    /// The newest frame that observers see and this client has not, or None.
    fn latest(&self, py: Python<'_>) -> PyResult<Option<PyFrame>> {
        let connection = self.connection(py)?;
        let latest = self.waiting(py, |hook| connection.latest(hook))?;
        latest.map(|frame| PyFrame::new(py, frame)).transpose()
    }

    /// The same; waits for it as long as ``timeout`` [s].
    fn wait_newer(&self, py: Python<'_>, timeout: f64) -> PyResult<Option<PyFrame>> {
        let connection = self.connection(py)?;
        let timeout = Duration::try_from_secs_f64(timeout).ok();
        let newer = self.waiting(py, |hook| connection.wait_newer(timeout, hook))?;
        newer.map(|frame| PyFrame::new(py, frame)).transpose()
    }

    /// Process in control, if any.
    fn controller(&self, py: Python<'_>) -> PyResult<Option<u32>> {
        let connection = self.connection(py)?;
        self.waiting(py, |hook| connection.controller(hook))
    }

    /// The number under which programs of XLA know this client, and how many calls they have made.
    fn xla_token(&self, py: Python<'_>) -> PyResult<(u32, u32)> {
        self.connection(py)?;
        Ok(py.detach(|| xla::token(&self.connection, &self.description)))
    }

    /// Give the lease back; the next command takes one again.
    fn release(&self, py: Python<'_>) -> PyResult<()> {
        let connection = self.connection(py)?;
        self.waiting(py, |hook| connection.release(hook))
    }

    /// Give the lease back and end the connection; calls after it raise ``SimClosed``.
    fn close(&self, py: Python<'_>) {
        let connection = self.held().take();
        py.detach(|| drop(connection));
    }
}

impl Client {
    fn connection(&self, py: Python<'_>) -> PyResult<Arc<Connection>> {
        let name = &self.description.name;
        if std::process::id() != self.process {
            // two processes on one connection would take each other's frames
            let problem = format!(
                "simulation `{name}` belongs to process {}, which this one was forked from; \
                 attach to it by name to observe, or launch another",
                self.process
            );
            return Err(raise(py, "LeaseHeld", problem));
        }
        // raising runs Python code, which must not find the lock held
        let connection = self.held().clone();
        connection.ok_or_else(|| self.closed(py))
    }

    fn held(&self) -> MutexGuard<'_, Option<Arc<Connection>>> {
        let client = self.connection.client.lock();
        client.unwrap_or_else(PoisonError::into_inner)
    }

    fn closed(&self, py: Python<'_>) -> PyErr {
        let name = &self.description.name;
        let problem = format!("simulation `{name}` was closed; launch or attach again");
        raise(py, "SimClosed", problem)
    }

    fn frame<F>(&self, py: Python<'_>, call: F) -> PyResult<PyFrame>
    where
        F: FnOnce(Hook<'_>) -> Result<sim_protocol::Frame, ProtocolError> + Send,
    {
        // only steps order themselves after what the card does
        if let Some(card) = self.card(py) {
            card.call_method0(py, "synchronize")?;
        }
        let frame = PyFrame::new(py, self.waiting(py, call)?)?;
        self.on_card(py, &frame);
        Ok(frame)
    }

    /// The frame of a step, after warnings of its values.
    fn advised(&self, py: Python<'_>, frame: sim_protocol::Frame) -> PyResult<PyFrame> {
        let frame = self.advice.frame(py, &self.description, frame)?;
        self.on_card(py, &frame);
        Ok(frame)
    }

    fn on_card(&self, py: Python<'_>, frame: &PyFrame) {
        if let Some(card) = self.card(py) {
            frame.put_on(py, &card);
        }
    }

    fn card(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        let card = self.card.lock().unwrap_or_else(PoisonError::into_inner);
        card.as_ref().map(|card| card.clone_ref(py))
    }

    /// Runs a call that may wait. Of one that fails after a signal handler or another thread closed the simulation, that
    /// is the reason.
    fn waiting<T, F>(&self, py: Python<'_>, call: F) -> PyResult<T>
    where
        T: Send,
        F: FnOnce(Hook<'_>) -> Result<T, ProtocolError> + Send,
    {
        waiting(py, call).map_err(|failure| match failure {
            Failure::Protocol(_) if self.held().is_none() => self.closed(py),
            failure => failure.raised(py),
        })
    }
}

/// What a step takes from device memory.
fn as_left((ready, commands): (u64, u64)) -> OnDevice {
    OnDevice { ready, commands }
}

/// Why a call that waits ended without a result.
enum Failure {
    /// A signal handler raised.
    Handler(PyErr),
    Protocol(ProtocolError),
}

impl Failure {
    fn raised(self, py: Python<'_>) -> PyErr {
        match self {
            Failure::Handler(raised) => raised,
            Failure::Protocol(error) => protocol(py, &error),
        }
    }
}

/// Runs a call that may wait, without the interpreter lock; Ctrl-C ends it with its exception.
fn waiting<T, F>(py: Python<'_>, call: F) -> Result<T, Failure>
where
    T: Send,
    F: FnOnce(Hook<'_>) -> Result<T, ProtocolError> + Send,
{
    let mut interrupt = None;
    let result = py.detach(|| {
        call(&mut || match Python::attach(|py| py.check_signals()) {
            Ok(()) => ControlFlow::Continue(()),
            Err(raised) => {
                interrupt = Some(raised);
                ControlFlow::Break(())
            }
        })
    });
    match interrupt {
        Some(raised) => Err(Failure::Handler(raised)),
        None => result.map_err(Failure::Protocol),
    }
}

/// Into how many groups the daemon of that name has split its worlds; 1 if it has not. One that is not ready is waited for
/// as long as ``wait`` [s]; left out, only one that starts already.
#[pyfunction]
#[pyo3(signature = (name, wait=None, /))]
pub(crate) fn groups(py: Python<'_>, name: &str, wait: Option<f64>) -> PyResult<usize> {
    let options = AttachOptions {
        wait: wait
            .and_then(|wait| Duration::try_from_secs_f64(wait).ok())
            .unwrap_or_default(),
        ..AttachOptions::default()
    };
    waiting(py, |hook| {
        let beacon = sim_protocol::find(name, &options, hook)?;
        Ok(beacon.groups)
    })
    .map_err(|failure| failure.raised(py))
}

/// Remove what a dead daemon of that name left behind; whether nothing is left, that is, false while one runs.
#[pyfunction]
pub(crate) fn sweep(py: Python<'_>, name: &str) -> PyResult<bool> {
    sim_protocol::cleanup_after_death(None, name).map_err(|error| protocol(py, &error))
}
