//! Compiled meshes that are kept from run to run.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};

use sim_model::geometry::{Mesh, MeshOptions, Shape, TriMesh, keep_meshes, triangles};

use super::files::{Folder, brick, gltf, gltf_buffer, joined, mapped, stl};

thread_local! {
    /// Where this test keeps meshes; other tests of the program keep none.
    static HERE: RefCell<Option<PathBuf>> = const { RefCell::new(None) };
}

/// A folder of files, and one of kept meshes inside it.
fn keeping(test: &str) -> Folder {
    let folder = Folder::new(test);
    HERE.set(Some(folder.as_ref().join("cache")));
    keep_meshes(|| HERE.with_borrow(Clone::clone));
    folder
}

fn kept(folder: &Folder) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.as_ref().join("cache/meshes"));
    let entries = entries.into_iter().flatten();
    entries.map(|entry| entry.unwrap().path()).collect()
}

/// Many balls in a row: so many triangles that reading them takes a while.
fn balls(radius: f64) -> TriMesh {
    let ball = triangles(&Shape::Sphere { radius });
    let count = 1 + 150_000 / ball.triangles.len();
    let balls: Vec<TriMesh> = (0..count)
        .map(|k| mapped(&ball, |[x, y, z]| [x + 3.0 * radius * k as f64, y, z]))
        .collect();
    joined(&balls)
}

fn load(path: &Path) -> Mesh {
    Mesh::load(path, [1.0; 3], &MeshOptions::default()).unwrap()
}

#[test]
fn a_kept_mesh_is_the_one_that_was_made() {
    let folder = keeping("kept-same");
    let path = folder.put("balls.stl", stl(&balls(0.1)));
    let options = MeshOptions {
        max_hull_vertices: 16,
        ..MeshOptions::default()
    };
    let made = Mesh::load(&path, [1.0, -2.0, 3.0], &options).unwrap();
    assert_eq!(kept(&folder).len(), 1);
    assert!(!made.notes.is_empty(), "a hull of few vertices has a note");
    assert_eq!(Mesh::load(&path, [1.0, -2.0, 3.0], &options).unwrap(), made);
    // content decides, not the name
    let copy = folder.put("copy.stl", stl(&balls(0.1)));
    let other = Mesh::load(&copy, [1.0, -2.0, 3.0], &options).unwrap();
    assert_eq!((&other.path, &other.triangles), (&copy, &made.triangles));
    assert_eq!(kept(&folder).len(), 1);
    // without a cache it is the same
    HERE.set(None);
    assert_eq!(Mesh::load(&path, [1.0, -2.0, 3.0], &options).unwrap(), made);
}

#[test]
fn what_is_kept_is_used_and_not_made_again() {
    let folder = keeping("kept-used");
    let [a, b] = [0.1, 0.2].map(|radius| folder.put(&format!("{radius}.stl"), stl(&balls(radius))));
    let small = load(&a);
    let [place] = &kept(&folder)[..] else {
        panic!()
    };
    let of_small = fs::read(place).unwrap();
    fs::remove_file(place).unwrap();
    assert!(load(&b).triangles != small.triangles);
    let [place] = &kept(&folder)[..] else {
        panic!()
    };
    fs::write(place, of_small).unwrap();
    assert_eq!(load(&b).triangles, small.triangles);
}

#[test]
fn scale_options_and_content_tell_meshes_apart() {
    let folder = keeping("kept-apart");
    let path = folder.put("balls.stl", stl(&balls(0.1)));
    let usual = load(&path);
    let scaled = Mesh::load(&path, [2.0, 1.0, 1.0], &MeshOptions::default()).unwrap();
    assert!(scaled.triangles.extent()[1][0] > 1.9 * usual.triangles.extent()[1][0]);
    let few = MeshOptions {
        max_hull_vertices: 8,
        ..MeshOptions::default()
    };
    let rough = Mesh::load(&path, [1.0; 3], &few).unwrap();
    assert!(rough.hulls[0].vertices.len() <= 8 && usual.hulls[0].vertices.len() > 8);
    folder.put("balls.stl", stl(&balls(0.3)));
    assert!(load(&path).triangles.extent()[1][2] > 0.29);
    assert_eq!(kept(&folder).len(), 4);
}

#[test]
fn a_damaged_file_is_made_again() {
    let folder = keeping("kept-damaged");
    let path = folder.put("balls.stl", stl(&balls(0.1)));
    let made = load(&path);
    let [place] = &kept(&folder)[..] else {
        panic!()
    };
    let whole = fs::read(place).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 16;
    for damaged in [&flipped, &whole[..whole.len() / 2], &whole[..5], &[][..]] {
        fs::write(place, damaged).unwrap();
        assert_eq!(load(&path), made);
        assert!(fs::read(place).unwrap() == whole, "it is kept anew");
    }
}

#[test]
fn a_buffer_beside_a_gltf_file_is_part_of_it() {
    let folder = keeping("kept-beside");
    let text = |mesh: &TriMesh| gltf(mesh, "\"uri\":\"balls.bin\",", r#"{"mesh":0}"#);
    let (small, other) = (balls(0.1), balls(0.2));
    assert_eq!(text(&small).len(), text(&other).len());
    let path = folder.put("balls.gltf", text(&small));
    folder.put("balls.bin", gltf_buffer(&small));
    let first = load(&path);
    assert_eq!((load(&path), kept(&folder).len()), (first.clone(), 1));
    folder.put("balls.bin", gltf_buffer(&other));
    assert!(load(&path).triangles.extent()[1][1] > 1.9 * first.triangles.extent()[1][1]);
    fs::remove_file(folder.as_ref().join("balls.bin")).unwrap();
    assert!(Mesh::load(&path, [1.0; 3], &MeshOptions::default()).is_err());
}

#[test]
fn a_mesh_that_is_made_at_once_is_not_kept() {
    let folder = keeping("kept-quick");
    load(&folder.put("brick.stl", stl(&brick())));
    assert!(kept(&folder).is_empty());
}
