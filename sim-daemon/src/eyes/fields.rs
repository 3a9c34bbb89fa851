//! Fields of images: `CAMERA_depth`, `CAMERA_segmentation` and `CAMERA_rgb`.

use sim_model::{Camera, Description};
use sim_physics::arrays::Field;
use sim_protocol::{Dtype, FieldInfo};

use crate::config::CameraTable;
use crate::error::DaemonError;

/// What an image tells of each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plane {
    /// How far what is seen is away.
    Depth,
    /// What is seen.
    Segmentation,
    /// In which colour.
    Rgb,
}

impl Plane {
    pub(crate) const ALL: [Plane; 3] = [Plane::Depth, Plane::Segmentation, Plane::Rgb];

    fn suffix(self) -> &'static str {
        match self {
            Plane::Depth => "_depth",
            Plane::Segmentation => "_segmentation",
            Plane::Rgb => "_rgb",
        }
    }

    fn dtype(self) -> Dtype {
        match self {
            Plane::Depth => Dtype::F32,
            Plane::Segmentation => Dtype::I32,
            Plane::Rgb => Dtype::U8,
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Plane::Depth => "m",
            Plane::Segmentation | Plane::Rgb => "–",
        }
    }

    fn doc(self) -> &'static str {
        match self {
            Plane::Depth => "Depth along the camera's axis; 0 where nothing is seen.",
            Plane::Segmentation => "Index in segment_names of what is seen; -1 for nothing.",
            Plane::Rgb => "Red, green and blue of each pixel, 0 to 255, in one light with shadows.",
        }
    }
}

/// A field with an image per world.
#[derive(Clone, Debug)]
pub(crate) struct ImageField {
    /// The camera, by its index in the scene.
    pub(super) camera: usize,
    pub(super) plane: Plane,
    pub(crate) name: String,
    pub(crate) dtype: Dtype,
    /// `(worlds, height, width)`, of colours with an axis of 3 more
    pub(crate) shape: Vec<usize>,
    /// From the start of the arena [bytes].
    pub(crate) offset: usize,
}

impl ImageField {
    /// The image of a camera in one world.
    pub(super) fn new(camera: usize, of_camera: &Camera, plane: Plane) -> Self {
        let mut shape = vec![1, of_camera.height, of_camera.width];
        shape.extend((plane == Plane::Rgb).then_some(3));
        ImageField {
            camera,
            plane,
            name: format!("{}{}", of_camera.name, plane.suffix()),
            dtype: plane.dtype(),
            shape,
            offset: 0,
        }
    }

    /// Bytes in all worlds, if memory can have so many.
    pub(super) fn checked_bytes(&self) -> Option<usize> {
        let entry = self.dtype.size();
        self.shape
            .iter()
            .try_fold(entry, |all, &n| all.checked_mul(n))
    }

    pub(super) fn bytes(&self) -> usize {
        self.shape.iter().product::<usize>() * self.dtype.size()
    }

    /// As clients see one that frames do not have.
    pub(crate) fn known(&self) -> FieldInfo {
        FieldInfo {
            shape: Vec::new(),
            ..self.info()
        }
    }

    /// As clients see it.
    pub(crate) fn info(&self) -> FieldInfo {
        FieldInfo {
            name: self.name.clone(),
            dtype: self.dtype,
            shape: self.shape.clone(),
            axes: match self.plane {
                Plane::Rgb => "(worlds, height, width, 3)".to_owned(),
                _ => "(worlds, height, width)".to_owned(),
            },
            unit: self.plane.unit().to_owned(),
            doc: self.plane.doc().to_owned(),
        }
    }
}

/// Fields that frames are asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameFields {
    /// Those of the simulation.
    pub fields: Vec<Field>,
    /// Names of images. Whether the scene has their cameras is not known here.
    pub images: Vec<String>,
    /// Cameras besides those of the scene.
    pub cameras: Vec<CameraTable>,
    /// Whether cameras see every world, also those of some worlds.
    pub of_every_world: bool,
}

impl FrameFields {
    /// The fields of these names, with `body_q` where there are images: cameras see bodies where it has them.
    ///
    /// # Errors
    /// The first name that no field has, whatever the cameras.
    pub fn named<'a>(names: impl IntoIterator<Item = &'a str>) -> Result<FrameFields, &'a str> {
        let mut asked = FrameFields::default();
        for name in names {
            match Field::named(name) {
                Some(field) => asked.fields.push(field),
                None if Plane::ALL
                    .iter()
                    .any(|plane| name.ends_with(plane.suffix())) =>
                {
                    asked.images.push(name.to_owned());
                }
                None => return Err(name),
            }
        }
        if !asked.images.is_empty() {
            asked.fields.push(Field::BodyQ);
        }
        Ok(asked)
    }
}

impl FrameFields {
    /// The fields that an argument of the command line names.
    ///
    /// # Errors
    /// A name that no field has, with those that there are.
    pub(crate) fn of_argument(names: &[String]) -> Result<FrameFields, DaemonError> {
        let names = names.iter().map(|name| name.trim());
        FrameFields::named(names.filter(|name| !name.is_empty())).map_err(|name| {
            let known: Vec<_> = Field::ALL.iter().map(|field| field.row().name).collect();
            DaemonError::Argument {
                argument: "fields",
                value: name.to_owned(),
                problem: format!("unknown field; known are {}", known.join(", ")),
            }
        })
    }
}

impl From<&[Field]> for FrameFields {
    fn from(fields: &[Field]) -> FrameFields {
        FrameFields {
            fields: fields.to_vec(),
            ..FrameFields::default()
        }
    }
}

/// All images of a world that a scene's cameras have, camera by camera.
pub(crate) fn known(scene: &Description) -> impl Iterator<Item = ImageField> {
    let cameras = scene.cameras.iter().enumerate();
    cameras.flat_map(|(index, camera)| {
        Plane::ALL.map(move |plane| ImageField::new(index, camera, plane))
    })
}
