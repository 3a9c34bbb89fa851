//! Mesh files of each format, as shapes that touch and as pictures show them.

use sim_model::geometry::{Mesh, MeshOptions, VisualMesh};

use super::files;

/// What parts an OBJ file from the MTL file beside it.
const BESIDE: &[u8] = b"\n#mtl\n";

fn read(name: &str, bytes: &[u8]) {
    let path = files::file(name, bytes);
    for collada_up_axis in [false, true] {
        if let Ok(mesh) = VisualMesh::load(&path, collada_up_axis) {
            let vertices = mesh.vertices.len();
            let corners = mesh.triangles.as_flattened();
            assert!(corners.iter().all(|&corner| (corner as usize) < vertices));
            assert_eq!(mesh.colors.len(), mesh.triangles.len());
            for texture in &mesh.textures {
                let triangles = mesh.triangles.len();
                assert!(texture.triangles.iter().all(|&t| (t as usize) < triangles));
                assert_eq!(texture.tints.len(), texture.triangles.len());
                let uv = texture.uv.as_ref();
                assert!(uv.is_none_or(|uv| uv.len() == texture.triangles.len()));
            }
        }
    }
    let options = MeshOptions::default();
    match Mesh::load(&path, [1.0, -2.0, 0.5], &options) {
        Ok(mesh) => {
            assert!(!mesh.hulls.is_empty());
            let numbers = mesh.triangles.vertices.as_flattened();
            assert!(numbers.iter().all(|x| x.is_finite()));
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.len() < 4096, "{} bytes: {message}", message.len());
        }
    }
}

/// An STL file, as text or in binary.
pub fn stl(bytes: &[u8]) {
    read("mesh.stl", bytes);
}

/// An OBJ file, then a line `#mtl` and the file `mesh.mtl` that it may name.
pub fn obj(bytes: &[u8]) {
    let cut = bytes.windows(BESIDE.len()).position(|part| part == BESIDE);
    let (obj, mtl) = match cut {
        Some(at) => (&bytes[..at + 1], &bytes[at + BESIDE.len()..]),
        None => (bytes, &b""[..]),
    };
    files::file("mesh.mtl", mtl);
    read("mesh.obj", obj);
}

/// A COLLADA file.
pub fn dae(bytes: &[u8]) {
    read("mesh.dae", bytes);
}

/// A glTF file, as JSON or in binary.
pub fn gltf(bytes: &[u8]) {
    let name = match bytes.starts_with(b"glTF") {
        true => "mesh.glb",
        false => "mesh.gltf",
    };
    read(name, bytes);
}
