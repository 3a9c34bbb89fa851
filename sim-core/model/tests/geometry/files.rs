//! Meshes as the bytes of files, and a folder to put them in.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sim_model::geometry::{Mesh, MeshOptions, TriMesh, mass_properties, triangles};
use sim_model::{Inertial, ModelError, Robot, Shape, UrdfOptions};

/// A folder of its own for each test, removed at the end.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(test: &str) -> Folder {
        let path =
            std::env::temp_dir().join(format!("tightloop-geometry-{}-{test}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    /// Writes a file and says where it is.
    pub fn put(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Loads a file of these bytes as it is.
    pub fn load(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, ModelError> {
        Mesh::load(&self.put(name, bytes), [1.0; 3], &MeshOptions::default())
    }

    /// Reads the robot `r` whose only link `hand` has this file as its only collision, and holds this besides.
    pub fn robot(&self, file: &str, inside: &str) -> Result<Robot, ModelError> {
        let text = format!(
            "<robot name=\"r\"><link name=\"hand\">{inside}<collision><geometry>\
             <mesh filename=\"{file}\"/></geometry></collision></link></robot>"
        );
        Robot::from_urdf_text(&text, self.0.join("r.urdf"), UrdfOptions::default())
    }
}

impl AsRef<Path> for Folder {
    fn as_ref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The message with which bytes are refused.
#[track_caller]
pub fn refusal(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let folder = Folder::new(&name.replace('/', "-"));
    match folder.load(name, bytes) {
        Ok(mesh) => panic!("accepted: {mesh:?}"),
        Err(error) => error.to_string(),
    }
}

/// Mass properties of a mesh at density 1.
#[track_caller]
pub fn unit_density(mesh: &Mesh) -> Inertial {
    mass_properties(&Shape::Mesh(Arc::new(mesh.clone())), 1.0).unwrap()
}

/// Asserts that two bodies weigh and turn alike, to a share of the larger's mass and inertia.
#[track_caller]
pub fn assert_alike(a: &Inertial, b: &Inertial, share: f64) {
    let turn = (0..3)
        .map(|i| a.inertia[i][i].max(b.inertia[i][i]))
        .fold(0.0, f64::max);
    let length = (turn / a.mass).sqrt();
    assert!((a.mass - b.mass).abs() <= share * a.mass, "{a:?}\n{b:?}");
    for i in 0..3 {
        assert!(
            (a.pos[i] - b.pos[i]).abs() <= share * length,
            "{a:?}\n{b:?}"
        );
        for j in 0..3 {
            assert!(
                (a.inertia[i][j] - b.inertia[i][j]).abs() <= share * turn,
                "{a:?}\n{b:?}"
            );
        }
    }
}

/// A cuboid with its lowest corner at the origin; edges and corner are exact in f32.
pub fn brick() -> TriMesh {
    let mut mesh = triangles(&Shape::Box {
        half_extents: [0.5, 0.25, 0.125],
    });
    for vertex in &mut mesh.vertices {
        for (x, half) in vertex.iter_mut().zip([0.5, 0.25, 0.125]) {
            *x += half;
        }
    }
    mesh
}

/// Every vertex through a map.
pub fn mapped(mesh: &TriMesh, map: impl Fn([f64; 3]) -> [f64; 3]) -> TriMesh {
    TriMesh {
        vertices: mesh.vertices.iter().map(|&vertex| map(vertex)).collect(),
        triangles: mesh.triangles.clone(),
    }
}

/// Several meshes in one.
pub fn joined(meshes: &[TriMesh]) -> TriMesh {
    let mut all = TriMesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(
            mesh.triangles
                .iter()
                .map(|corners| corners.map(|corner| corner + first)),
        );
    }
    all
}

/// The same surface, seen from the other side.
pub fn inside_out(mesh: &TriMesh) -> TriMesh {
    TriMesh {
        vertices: mesh.vertices.clone(),
        triangles: mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
    }
}

pub fn stl(mesh: &TriMesh) -> Vec<u8> {
    let mut bytes = b"solid, although it is binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for &triangle in &mesh.triangles {
        bytes.extend([0; 12]);
        for x in mesh.corners(triangle).into_iter().flatten() {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

pub fn stl_text(mesh: &TriMesh) -> String {
    let mut text = "solid brick\n".to_owned();
    for &triangle in &mesh.triangles {
        text += " facet normal 0 0 0\n  outer loop\n";
        for [x, y, z] in mesh.corners(triangle) {
            let _ = writeln!(text, "   vertex {x:e} {y:e} {z:e}");
        }
        text += "  endloop\n endfacet\n";
    }
    text + "endsolid brick\n"
}

pub fn obj(mesh: &TriMesh) -> String {
    let mut text = "# a comment\nmtllib none.mtl\no one\n".to_owned();
    for [x, y, z] in &mesh.vertices {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    let half = mesh.triangles.len() / 2;
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        if index == half {
            text += "g two\nusemtl none\n";
        }
        // the second half counts backwards
        let corners = triangle.map(|corner| {
            if index < half {
                i64::from(corner) + 1
            } else {
                i64::from(corner) - mesh.vertices.len() as i64
            }
        });
        let _ = writeln!(
            text,
            "f {}/1/2 {}//3 {}",
            corners[0], corners[1], corners[2]
        );
    }
    text
}

/// A COLLADA file with this asset and these nodes, whose geometry is `#mesh`.
pub fn dae(mesh: &TriMesh, asset: &str, nodes: &str) -> String {
    let numbers: Vec<String> = mesh.vertices.iter().flatten().map(f64::to_string).collect();
    let count = mesh.vertices.len();
    // a second input, as of normals, comes between
    let corners: Vec<String> = mesh
        .triangles
        .iter()
        .flatten()
        .map(|corner| format!("0 {corner}"))
        .collect();
    format!(
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\
         <asset>{asset}</asset><library_geometries><geometry id=\"mesh\"><mesh>\
         <source id=\"p\"><float_array id=\"a\" count=\"{}\">{}</float_array><technique_common>\
         <accessor source=\"#a\" count=\"{count}\" stride=\"3\"/></technique_common></source>\
         <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>\
         <triangles count=\"{}\"><input semantic=\"NORMAL\" offset=\"0\" source=\"#p\"/>\
         <input semantic=\"VERTEX\" offset=\"1\" source=\"#v\"/><p>{}</p></triangles></mesh></geometry></library_geometries>\
         <library_visual_scenes><visual_scene id=\"s\">{nodes}</visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
        3 * count,
        numbers.join(" "),
        mesh.triangles.len(),
        corners.join(" "),
    )
}

/// The node of a COLLADA file that shows its geometry as it is.
pub const PLAIN: &str = "<node><instance_geometry url=\"#mesh\"/></node>";

/// JSON of a glTF file with this buffer entry and nodes, for the bytes of [`gltf_buffer`].
pub fn gltf(mesh: &TriMesh, buffer: &str, nodes: &str) -> String {
    let (points, indices) = (12 * mesh.vertices.len(), 12 * mesh.triangles.len());
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{nodes}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{{buffer}"byteLength":{}}}],
        "bufferViews":[{{"buffer":0,"byteLength":{points}}},{{"buffer":0,"byteOffset":{points},"byteLength":{indices}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
                     {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}]}}"#,
        points + indices,
        mesh.vertices.len(),
        3 * mesh.triangles.len(),
    )
}

pub fn gltf_buffer(mesh: &TriMesh) -> Vec<u8> {
    let points = mesh
        .vertices
        .iter()
        .flatten()
        .flat_map(|&x| (x as f32).to_le_bytes());
    let indices = mesh
        .triangles
        .iter()
        .flatten()
        .flat_map(|corner| corner.to_le_bytes());
    points.chain(indices).collect()
}

pub fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend(((12 + 8 + json.len() + 8 + buffer.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", buffer)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}
