//! Frames: read-only NumPy views of shared memory that keep their sample alive.

use std::sync::{Mutex, OnceLock, PoisonError};

use numpy::ndarray::{ArrayViewD, IxDyn};
use numpy::npyffi::flags::NPY_ARRAY_WRITEABLE;
use numpy::{Element, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};
use sim_protocol::{Dtype, View};

use crate::errors::raise;

/// Arrays made so far, each with its field's name: an empty field lies where the next one does.
type Made = Vec<(String, Py<PyAny>)>;

/// What every array of a frame holds on to. The slot in shared memory is given back when the last of them goes.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Sample(sim_protocol::Frame);

/// The state of all worlds at one instant: each field is a read-only NumPy view of shared memory, worlds first.
///
/// A frame, and every array taken from it, stays valid and unchanged until dropped, even after the daemon died.
/// At most ``frames_held`` frames may be alive; ``copy()`` is for those to keep.
///
/// Every array begins at a multiple of 64 bytes, so other libraries take it as it is: ``np.from_dlpack``,
/// ``torch.from_dlpack`` and ``jax.device_put`` copy nothing, and what they return keeps the frame alive. torch knows no
/// read-only memory: writing to such a tensor ends the process, so ``clone()`` it first. JAX copies 64-bit arrays unless
/// it runs with ``jax_enable_x64``, and its ``from_dlpack`` refuses arrays that are read-only.
#[pyclass(frozen, name = "Frame", module = "tightloop")]
pub(crate) struct PyFrame {
    // not the frame itself, which keeps the arrays made so far: that would be a circle
    sample: Py<Sample>,
    arrays: Mutex<Made>,
    /// `tightloop.gpu.card.Card`, if the frame is on the card too.
    card: OnceLock<Py<PyAny>>,
}

#[pymethods]
impl PyFrame {
    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let sample = self.sample.bind(py);
        let view = match sample.get().0.field(name) {
            Ok(view) => view,
            Err(_) => return Err(self.unknown(py, name)?),
        };
        let find = |arrays: &Made| {
            arrays
                .iter()
                .find(|(made, _)| made == name)
                .map(|(_, array)| array.bind(py).clone())
        };
        // not held while NumPy allocates, which may run other Python threads
        if let Some(array) = find(&self.arrays()) {
            return Ok(array);
        }
        static FRAME_ARRAY: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        let kind = FRAME_ARRAY.import(py, "tightloop.arrays.written", "FrameArray")?;
        let array = read_only(sample, &view).call_method1("view", (kind,))?;
        self.arrays()
            .push((name.to_owned(), array.clone().unbind()));
        Ok(array)
    }

    fn __setattr__(&self, py: Python<'_>, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        let problem = format!(
            "`{name}` of a frame is read-only, since it is the daemon's memory: `sim.write(joint_q=…)` and `sim.params` change worlds"
        );
        Err(raise(py, "CommandRefused", problem))
    }

    fn __getitem__(&self, py: Python<'_>, key: &Bound<'_, PyAny>) -> PyResult<()> {
        let problem = format!(
            "a frame has no entries, such as {}: its fields are attributes, with the worlds first: write `frame.joint_q[world]`",
            key.repr()?
        );
        Err(raise(py, "CommandRefused", problem))
    }

    fn __reduce__(&self, py: Python<'_>) -> PyResult<()> {
        let problem = "a frame cannot be copied by `copy` or pickled, since it is the daemon's memory; `frame.copy()` can";
        Err(raise(py, "CommandRefused", problem.to_owned()))
    }

    /// The field as a tensor of torch on the simulation's GPU, in the memory that the daemon writes.
    fn torch<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        Self::on_card(slf, name, "torch")
    }

    /// The field on the simulation's GPU with ``__cuda_array_interface__`` and ``__dlpack__``.
    fn cuda<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        Self::on_card(slf, name, "array")
    }

    /// The frame's arrays in memory of their own, as attributes of the same names. Takes no slot.
    fn copy<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let arrays = PyDict::new(py);
        let sample = self.sample.bind(py);
        for view in sample.get().0.fields() {
            arrays.set_item(view.name, read_only(sample, &view).call_method0("copy")?)?;
        }
        py.import("tightloop.arrays.frames")?
            .getattr("FrameCopy")?
            .call1((arrays, sim_daemon::field_names()))
    }

    /// Names of the fields that this frame carries.
    #[getter]
    fn fields(&self, py: Python<'_>) -> Vec<String> {
        self.sample
            .bind(py)
            .get()
            .0
            .fields()
            .map(|view| view.name.to_owned())
            .collect()
    }

    fn _repr_html_<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py()
            .import("tightloop.notebook")?
            .getattr("frame_html")?
            .call1((slf,))
    }

    fn __dir__(&self, py: Python<'_>) -> Vec<String> {
        let mut names = self.fields(py);
        names.extend(["copy", "cuda", "fields", "torch"].map(str::to_owned));
        names
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let views = self.sample.bind(py).get().0.fields();
        let fields: Vec<String> = views
            .map(|view| format!("{} {:?}", view.name, view.shape))
            .collect();
        format!("Frame({})", fields.join(", "))
    }
}

impl PyFrame {
    pub(crate) fn new(py: Python<'_>, frame: sim_protocol::Frame) -> PyResult<PyFrame> {
        Ok(PyFrame {
            sample: Py::new(py, Sample(frame))?,
            arrays: Mutex::default(),
            card: OnceLock::new(),
        })
    }

    /// Notes the card that has the frame too, if it has.
    pub(crate) fn put_on(&self, py: Python<'_>, card: &Py<PyAny>) {
        if self.sample.bind(py).get().0.header().slot > 0 {
            let _ = self.card.set(card.clone_ref(py));
        }
    }

    /// An array of the card, made by a method of `tightloop.gpu.card.Card`, which holds on to the sample.
    fn on_card<'py>(
        slf: &Bound<'py, Self>,
        name: &str,
        method: &str,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (py, py_frame) = (slf.py(), slf.get());
        let sample = py_frame.sample.bind(py);
        let frame = &sample.get().0;
        if frame.field(name).is_err() {
            return Err(py_frame.unknown(py, name)?);
        }
        let Some(card) = py_frame.card.get() else {
            let problem = format!(
                "`{name}` of this frame is not on a GPU that this process sees: call `sim.keep_on_gpu()` once after the \
                 launch, and take the tensors of frames that come after it"
            );
            return Err(raise(py, "GpuMemoryError", problem));
        };
        let header = frame.header();
        let arguments = (sample, name, header.slot - 1, header.done);
        card.bind(py).call_method1(method, arguments)
    }

    /// The same frame as another object.
    pub(crate) fn again(frame: &Bound<'_, PyFrame>) -> PyFrame {
        PyFrame {
            sample: frame.get().sample.clone_ref(frame.py()),
            arrays: Mutex::default(),
            card: OnceLock::new(),
        }
    }

    /// The error of a field that it does not carry.
    #[cold]
    fn unknown(&self, py: Python<'_>, name: &str) -> PyResult<PyErr> {
        let error = py
            .import("tightloop.arrays.frames")?
            .getattr("unknown_field")?
            .call1((name, self.fields(py), sim_daemon::field_names()))?;
        Ok(PyErr::from_value(error))
    }

    fn arrays(&self) -> std::sync::MutexGuard<'_, Made> {
        self.arrays.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A NumPy array over the field, which keeps the sample alive.
fn read_only<'py>(sample: &Bound<'py, Sample>, view: &View<'_>) -> Bound<'py, PyAny> {
    match view.dtype {
        Dtype::F32 => array::<f32>(sample, view),
        Dtype::F64 => array::<f64>(sample, view),
        Dtype::I32 => array::<i32>(sample, view),
        Dtype::U32 => array::<u32>(sample, view),
        Dtype::U64 => array::<u64>(sample, view),
        Dtype::U8 => array::<u8>(sample, view),
    }
}

fn array<'py, T: Element>(sample: &Bound<'py, Sample>, view: &View<'_>) -> Bound<'py, PyAny> {
    // SAFETY: `Table::parse` checked that the field lies inside the sample, is aligned and as long as its shape says.
    let entries = unsafe { ArrayViewD::from_shape_ptr(IxDyn(view.shape), view.ptr.cast::<T>()) };
    // SAFETY: the array holds `sample`, whose memory nobody writes to or gives back while it lives.
    let array = unsafe { PyArrayDyn::borrow_from_array(&entries, sample.clone().into_any()) };
    // SAFETY: the array is new, so nobody else looks at its flags.
    unsafe { (*array.as_array_ptr()).fields.flags &= !NPY_ARRAY_WRITEABLE };
    array.into_any()
}
