//! Names, shapes and units of a daemon, as C reads them.

use std::ffi::{CString, c_char};
use std::ptr::null;

use sim_protocol::{Description, Dtype, FieldInfo, InputInfo, Row};

use crate::status::{Failure, Status};

/// Type of the entries of an array.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryType {
    /// float
    F32 = 1,
    /// double
    F64 = 2,
    /// int32_t
    I32 = 3,
    /// uint32_t
    U32 = 4,
    /// uint64_t
    U64 = 5,
    /// uint8_t
    U8 = 6,
}

impl From<Dtype> for EntryType {
    fn from(dtype: Dtype) -> EntryType {
        match dtype {
            Dtype::F32 => EntryType::F32,
            Dtype::F64 => EntryType::F64,
            Dtype::I32 => EntryType::I32,
            Dtype::U32 => EntryType::U32,
            Dtype::U64 => EntryType::U64,
            Dtype::U8 => EntryType::U8,
        }
    }
}

/// An array that frames carry, or that a client may send.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct ArrayInfo {
    /// Name, such as "joint_q".
    pub name: *const c_char,
    /// Unit, such as "rad or m".
    pub unit: *const c_char,
    /// What it is, in one sentence.
    pub doc: *const c_char,
    /// Type of the entries in the daemon. Inputs may be sent as float or double.
    pub dtype: EntryType,
    /// Axes in use.
    pub axes: usize,
    /// Shape, worlds first, row-major; 1 for axes that are not in use.
    pub shape: [usize; 4],
}

/// What a daemon reports of itself. Its pointers are valid until tl_detach.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Described {
    /// Name of the daemon.
    pub name: *const c_char,
    /// Where the physics runs, such as "cpu".
    pub device: *const c_char,
    /// Number of worlds.
    pub worlds: usize,
    /// Degrees of freedom of a world: columns of joint_qd, joint_f and the targets.
    pub dofs: usize,
    /// Coordinates of a world: columns of joint_q.
    pub coords: usize,
    /// Physics step [s].
    pub dt: f64,
    /// Physics steps per control frame: each tl_step advances the worlds by substeps * dt.
    pub substeps: usize,
    /// Frames that this client may hold at once.
    pub frames_held: usize,
    /// "robot/joint" of each dof; dofs of them.
    pub dof_names: *const *const c_char,
    /// "robot/joint" of each coordinate; coords of them.
    pub coord_names: *const *const c_char,
    /// What each frame carries.
    pub fields: *const ArrayInfo,
    /// Number of fields.
    pub field_count: usize,
    /// What a step may set, with tl_set_f32 and tl_set_f64.
    pub inputs: *const ArrayInfo,
    /// Number of inputs.
    pub input_count: usize,
    /// What tl_write_f32 and tl_write_f64 may write.
    pub writes: *const ArrayInfo,
    /// Number of arrays that may be written.
    pub write_count: usize,
}

impl Described {
    pub(crate) const EMPTY: Described = Described {
        name: null(),
        device: null(),
        worlds: 0,
        dofs: 0,
        coords: 0,
        dt: 0.0,
        substeps: 0,
        frames_held: 0,
        dof_names: null(),
        coord_names: null(),
        fields: null(),
        field_count: 0,
        inputs: null(),
        input_count: 0,
        writes: null(),
        write_count: 0,
    };
}

/// A [`Described`], and the memory that it points to.
#[derive(Debug)]
pub(crate) struct DescriptionMemory {
    described: Described,
    _texts: Vec<CString>,
    _names: [Vec<*const c_char>; 2],
    _arrays: [Vec<ArrayInfo>; 3],
}

// SAFETY: nothing changes after `new`, and the pointers lead to heap memory of the fields beside them.
unsafe impl Send for DescriptionMemory {}
// SAFETY: as above.
unsafe impl Sync for DescriptionMemory {}

impl DescriptionMemory {
    pub(crate) fn new(from: &Description) -> Result<DescriptionMemory, Failure> {
        let mut texts = Vec::new();
        let mut keep = |text: &str| {
            let text = CString::new(text).map_err(|_| {
                let sentence = format!("the daemon: NUL in the text {text:?}; launch a new one");
                Failure::new(Status::Malformed, sentence)
            })?;
            let pointer = text.as_ptr();
            texts.push(text);
            Ok::<_, Failure>(pointer)
        };
        let dof_names = all(&from.dof_names, |name| keep(name))?;
        let coord_names = all(&from.coord_names, |name| keep(name))?;
        let fields = all(&from.fields, |field: &FieldInfo| {
            Ok(ArrayInfo {
                name: keep(&field.name)?,
                unit: keep(&field.unit)?,
                doc: keep(&field.doc)?,
                dtype: field.dtype.into(),
                axes: field.shape.len(),
                shape: padded(&field.shape),
            })
        })?;
        let mut input = |input: &InputInfo| {
            Ok(ArrayInfo {
                name: keep(&input.name)?,
                unit: keep(&input.unit)?,
                doc: keep(&input.doc)?,
                dtype: from.real().into(),
                axes: 2,
                shape: padded(&[from.worlds, input.columns]),
            })
        };
        let inputs = all(&from.commands, &mut input)?;
        let writes = all(&from.writes, &mut input)?;
        Ok(DescriptionMemory {
            described: Described {
                name: keep(&from.name)?,
                device: keep(&from.device)?,
                worlds: from.worlds,
                dofs: from.dof_names.len(),
                coords: from.coord_names.len(),
                dt: from.dt,
                substeps: from.substeps,
                frames_held: from.frames_held,
                dof_names: dof_names.as_ptr(),
                coord_names: coord_names.as_ptr(),
                fields: fields.as_ptr(),
                field_count: fields.len(),
                inputs: inputs.as_ptr(),
                input_count: inputs.len(),
                writes: writes.as_ptr(),
                write_count: writes.len(),
            },
            _texts: texts,
            _names: [dof_names, coord_names],
            _arrays: [fields, inputs, writes],
        })
    }

    pub(crate) fn described(&self) -> Described {
        self.described
    }
}

fn all<A, B>(from: &[A], make: impl FnMut(&A) -> Result<B, Failure>) -> Result<Vec<B>, Failure> {
    from.iter().map(make).collect()
}

/// A shape with ones for the axes that it does not have.
pub(crate) fn padded(shape: &[usize]) -> [usize; Row::AXES] {
    std::array::from_fn(|axis| shape.get(axis).copied().unwrap_or(1))
}
