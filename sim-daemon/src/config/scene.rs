//! Scene files: what they hold, and the description that this stands for.

use std::borrow::Cow;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sim_engine::dynamics::Dynamics;
use sim_model::files;
use sim_model::{Cone, Description, FrictionCombine, Solver, check_counts};

use super::bodies::BodyTable;
use super::cameras::CameraTable;
use super::error::ConfigError;
use super::mujoco::MujocoTable;
use super::number::Number;
use super::paths;
use super::randomize::{RandomizeTable, param};
use super::robots::RobotTable;
use super::sensors::{ContactSensorTable, HeightScanTable, SiteTable};
use super::shapes::ShapeTable;
use crate::output;

/// Largest scene file [bytes]: a hundred thousand shapes have some ten megabytes.
pub(crate) const SCENE_MAX: u64 = 32 << 20;
/// Longest line of a message: the list of all entries that a table may have has some hundred bytes.
const LINE_MAX: usize = 1000;

/// What is said of a robot file in place of a scene.
const XML: &str = "this is XML and not a scene; name a URDF file in a scene file (dt = 0.002, substeps = 4, [[robot]], \
                   name = \"arm\", urdf = \"robot.urdf\"), or give an MJCF file that ends in .xml to the command of the \
                   Python package; in Python, `Scene.add_urdf` and `Scene.from_mujoco` read robot files";

/// What is said of a file that has nothing of a scene.
const NO_SCENE: &str = "; give a scene file, such as `Scene.save` writes (dt = 0.002, substeps = 4, [[robot]], \
                        name = \"arm\", urdf = \"robot.urdf\")";

/// A scene as a file holds it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Length of one physics step [s].
    pub dt: Number,
    /// Physics steps in a control frame.
    pub substeps: usize,
    /// Gravity in world axes [m/s²].
    #[serde(default = "gravity")]
    pub gravity: [Number; 3],
    /// Parameters that vary from world to world, by their names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub params: Vec<String>,
    /// Largest delay of commands that a world may have, where that varies [substeps]; left out, four control frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command_delay_max: Option<usize>,
    /// Most contacts that a world has room for; left out, as many as its shapes suggest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contacts_max: Option<usize>,
    /// Most constraint rows of contacts that a world has room for; left out, as many as its contacts need.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows_max: Option<usize>,
    /// How the coefficients of friction of two shapes combine.
    #[serde(default, skip_serializing_if = "CombineName::is_max")]
    pub friction_combine: CombineName,
    /// Pairs that never touch: `shape`, `body/shape` or `robot/link/shape`, or a robot, body or link for all its shapes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contact_filters: Vec<[String; 2]>,
    /// Options of the constraint solver.
    #[serde(default)]
    pub solver: SolverTable,
    /// What a reset draws of the start state and of parameters.
    #[serde(default, skip_serializing_if = "RandomizeTable::is_empty")]
    pub randomize: RandomizeTable,
    /// Shapes: static ones, and those of bodies and links.
    #[serde(default, rename = "shape", skip_serializing_if = "Vec::is_empty")]
    pub shapes: Vec<ShapeTable>,
    /// Robots, in the order of their dofs.
    #[serde(default, rename = "robot", skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotTable>,
    /// MuJoCo models, in the order of their dofs, after all robots.
    #[serde(default, rename = "mujoco", skip_serializing_if = "Vec::is_empty")]
    pub mujoco: Vec<MujocoTable>,
    /// Rigid bodies, in the order of their dofs, after all robots and models.
    #[serde(default, rename = "body", skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<BodyTable>,
    /// Frames of interest.
    #[serde(default, rename = "site", skip_serializing_if = "Vec::is_empty")]
    pub sites: Vec<SiteTable>,
    /// Sums of contact forces.
    #[serde(
        default,
        rename = "contact_sensor",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub contact_sensors: Vec<ContactSensorTable>,
    /// Grids of vertical rays under frames.
    #[serde(default, rename = "height_scan", skip_serializing_if = "Vec::is_empty")]
    pub height_scans: Vec<HeightScanTable>,
    /// Cameras, whose images are fields of frames.
    #[serde(default, rename = "camera", skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<CameraTable>,
}

fn gravity() -> [Number; 3] {
    Description::new(1.0, 1).gravity.map(Number)
}

/// Options of the constraint solver; what is left out has its default.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverTable {
    /// Most Newton iterations of a step.
    pub iterations: usize,
    /// Most line-search iterations of a Newton iteration.
    pub ls_iterations: usize,
    /// Scaled improvement below which the solver stops [–].
    pub tolerance: Number,
    /// Shape of the friction cone.
    pub cone: ConeName,
    /// Friction impedance over normal impedance [–].
    pub impratio: Number,
}

impl Default for SolverTable {
    fn default() -> SolverTable {
        let solver = Solver::default();
        SolverTable {
            iterations: solver.iterations,
            ls_iterations: solver.ls_iterations,
            tolerance: Number(solver.tolerance),
            cone: ConeName::Elliptic,
            impratio: Number(solver.impratio),
        }
    }
}

/// Shape of the friction cone, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ConeName {
    /// The cone of Coulomb's law.
    Elliptic,
    /// A pyramid inside it.
    Pyramidal,
}

/// How friction combines, by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CombineName {
    /// The larger coefficient counts.
    #[default]
    Max,
    /// The mean.
    Mean,
    /// The smaller one.
    Min,
    /// The product.
    Product,
}

impl CombineName {
    fn is_max(&self) -> bool {
        *self == CombineName::Max
    }
}

/// Reads a scene file.
///
/// # Errors
/// A file that is missing or not TOML, or an entry that is unknown or of a wrong type, with its line.
pub fn load(path: &Path) -> Result<SceneFile, ConfigError> {
    let fault = |reason: String| ConfigError::Read {
        path: path.to_owned(),
        reason,
    };
    let bytes = files::read(path, SCENE_MAX).map_err(|error| fault(error.reason()))?;
    let wide = [b"\xff\xfe", b"\xfe\xff"]
        .iter()
        .any(|mark| bytes.starts_with(*mark));
    let text = String::from_utf8(bytes).map_err(|_| {
        let encoding = if wide {
            "it is UTF-16 text"
        } else {
            "it is not UTF-8 text"
        };
        fault(format!("{encoding}; save it as UTF-8"))
    })?;
    parse(&text, &path.display().to_string())
}

/// Reads a scene from TOML; `place` names the text in messages.
///
/// # Errors
/// Text that is not TOML, or an entry that is unknown or of a wrong type, with its line.
pub fn parse(text: &str, place: &str) -> Result<SceneFile, ConfigError> {
    // a byte order mark, as editors of Windows write one
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim_start().starts_with('<') {
        return Err(syntax(place, XML));
    }
    toml::from_str(text).map_err(|error| {
        let reason = error.to_string();
        let is_scene = text.lines().any(|line| {
            let line = line.trim_start();
            line.starts_with("[[robot]]")
                || line.split('=').next().is_some_and(|key| key.trim() == "dt")
        });
        let cure = if is_scene { "" } else { NO_SCENE };
        syntax(place, &format!("{}{cure}", reason.trim_end()))
    })
}

fn syntax(place: &str, reason: &str) -> ConfigError {
    // a parser quotes whole lines and names, which may be all of a file
    let lines: Vec<_> = reason.trim_end().lines().map(shortened).collect();
    ConfigError::Syntax {
        place: place.to_owned(),
        reason: lines.join("\n"),
    }
}

/// A line without its middle, where it is long.
fn shortened(line: &str) -> Cow<'_, str> {
    if line.len() <= LINE_MAX {
        return line.into();
    }
    let (head, tail) = (
        line.floor_char_boundary(LINE_MAX / 2),
        line.ceil_char_boundary(line.len() - LINE_MAX / 2),
    );
    format!(
        "{} … {}",
        line[..head].trim_end(),
        line[tail..].trim_start()
    )
    .into()
}

impl SceneFile {
    /// The scene as TOML.
    pub fn to_toml(&self) -> String {
        let text = toml::to_string(self).expect("every entry has a form in TOML");
        // TOML, unlike JSON, has a number for infinity; only lists and numbers of joint values can hold it
        let mut lines = String::with_capacity(text.len());
        for line in text.lines() {
            if line.starts_with("joint_") {
                lines.push_str(&line.replace("\"inf\"", "inf"));
            } else {
                lines.push_str(line);
            }
            lines.push('\n');
        }
        lines
    }

    /// The scene as JSON, infinity as the string `"inf"`.
    pub fn to_json(&self) -> serde_json::Value {
        serde_json::to_value(self).expect("every entry has a form in JSON")
    }

    /// Reads a scene from JSON text.
    ///
    /// # Errors
    /// Text that is not JSON, or an entry that is unknown or of a wrong type, with its place.
    pub fn from_json(text: &str) -> Result<SceneFile, ConfigError> {
        serde_json::from_str(text).map_err(|error| syntax("scene", &error.to_string()))
    }

    /// Writes the scene as TOML, with paths made relative to that file; so far they are relative to `base_dir`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path, base_dir: &Path) -> Result<(), ConfigError> {
        let mut scene = self.clone();
        let folder = path.parent().unwrap_or(Path::new(""));
        for robot in &mut scene.robots {
            for path in std::iter::once(&mut robot.urdf).chain(&mut robot.package_dirs) {
                *path = paths::relative_to(folder, &base_dir.join(&*path));
            }
        }
        for model in &mut scene.mujoco {
            model.model = paths::relative_to(folder, &base_dir.join(&model.model));
        }
        for path in scene
            .shapes
            .iter_mut()
            .filter_map(|shape| shape.path.as_mut())
        {
            *path = paths::relative_to(folder, &base_dir.join(&*path));
        }
        output::write(path, scene.to_toml().as_bytes()).map_err(|error| ConfigError::Write {
            path: path.to_owned(),
            reason: error.to_string(),
        })
    }

    /// Lets all cameras see every world: who looks at a world sees it, whether the run draws it or not.
    pub(crate) fn see_every_world(&mut self) {
        for camera in &mut self.cameras {
            camera.worlds = None;
        }
    }

    /// The description this scene stands for, checked; relative paths are looked for in `base_dir`.
    ///
    /// # Errors
    /// A robot file or a value that cannot be used, by name.
    pub fn describe(&self, base_dir: &Path) -> Result<Description, ConfigError> {
        // a free body has six dofs; large scenes would take minutes to build before these are found
        let free = self.bodies.iter().filter(|body| !body.fixed).count();
        check_counts(6 * free, self.shapes.len())?;
        let mut description = Description::new(self.dt.0, self.substeps);
        description.gravity = self.gravity.map(|part| part.0);
        for name in &self.params {
            description.params.insert(param(name)?);
        }
        description.friction_combine = match self.friction_combine {
            CombineName::Max => FrictionCombine::Max,
            CombineName::Mean => FrictionCombine::Mean,
            CombineName::Min => FrictionCombine::Min,
            CombineName::Product => FrictionCombine::Product,
        };
        description.filters = self.contact_filters.clone();
        description.command_delay_max = self.command_delay_max;
        description.contacts_max = self.contacts_max;
        description.rows_max = self.rows_max;
        description.solver = Solver {
            iterations: self.solver.iterations,
            ls_iterations: self.solver.ls_iterations,
            tolerance: self.solver.tolerance.0,
            cone: match self.solver.cone {
                ConeName::Elliptic => Cone::Elliptic,
                ConeName::Pyramidal => Cone::Pyramidal,
            },
            impratio: self.solver.impratio.0,
        };
        let bodies: Vec<&str> = self.bodies.iter().map(|body| body.name.as_str()).collect();
        for (index, shape) in self.shapes.iter().enumerate() {
            shape.check_body(index, &bodies)?;
            if shape.body.is_none() {
                let name = shape.name.as_deref().unwrap_or_default();
                let geometry = shape.shape(index, base_dir)?;
                description.add_shape(name, geometry, shape.pose()).surface = shape.surface();
            }
        }
        for table in &self.robots {
            let robot =
                description.add_urdf(base_dir.join(&table.urdf), table.options(base_dir))?;
            table.set_surfaces(robot);
            table.set_joints(robot)?;
        }
        for table in &self.mujoco {
            description.add_robot(table.robot(base_dir)?)?;
        }
        for (index, shape) in self.shapes.iter().enumerate() {
            if let Some((robot, link)) = shape.link() {
                let collision = shape.collision(index, base_dir)?;
                description.add_link_shape(robot, link, collision)?;
            }
        }
        for table in &self.bodies {
            description.add_body(table.body(&self.shapes, base_dir)?)?;
        }
        description.sites = self.sites.iter().map(SiteTable::site).collect();
        let sensors = self.contact_sensors.iter();
        description.contact_sensors = sensors.map(ContactSensorTable::sensor).collect();
        description.height_scans = self
            .height_scans
            .iter()
            .map(HeightScanTable::scan)
            .collect();
        let cameras = self.cameras.iter().map(CameraTable::camera);
        description.cameras = cameras.collect::<Result<_, _>>()?;
        self.randomize.write(&mut description)?;
        description.validate()?;
        Ok(description)
    }

    /// Kinematics and dynamics of the scene at states that a caller gives; paths as in [`SceneFile::describe`].
    ///
    /// # Errors
    /// As [`SceneFile::describe`], and a mass matrix that cannot be factored.
    pub fn dynamics(&self, base_dir: &Path) -> Result<Dynamics, ConfigError> {
        Ok(Dynamics::new(self.describe(base_dir)?.compile()?))
    }
}
