//! Where the triangles of placed meshes fall in a picture, tile by tile.

use crate::clip::{Ahead, clipped, is_free};
use crate::cover::{SUB, floor};
use crate::mesh::{Level, Piece};
use crate::threads;

/// Side of a tile [pixels]: what is seen in it stays in cache.
pub(crate) const TILE: usize = 32;
/// Faces that a thread takes at once.
const WORK: usize = 16_384;

/// A piece of a mesh at its place, as a camera sees it.
pub(crate) struct Placed<'a> {
    pub piece: &'a Piece,
    pub level: usize,
    /// Whether it is seen from outside only.
    pub closed: bool,
    /// Which of the placed meshes that are looked at it is a piece of.
    pub look: u32,
    /// From the mesh's frame to `Ahead`: rows of a matrix, the translation last.
    pub ahead: [[f32; 4]; 3],
    /// Whether what is behind shows through.
    pub translucent: bool,
}

impl Placed<'_> {
    pub fn level(&self) -> &Level {
        &self.piece.levels[self.level]
    }
}

/// From `Ahead` to pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    pub width: usize,
    pub height: usize,
    /// Half of the longer side [pixels].
    pub half: f32,
    /// Whether what is far is small.
    pub perspective: bool,
    /// Nearest that is drawn [m].
    pub nearest: f32,
}

impl Lens {
    pub fn columns(&self) -> usize {
        self.width.div_ceil(TILE)
    }

    pub fn tiles(&self) -> usize {
        self.columns() * self.height.div_ceil(TILE)
    }

    /// Place in the picture [pixels], and how near it is: linear over the picture on any plane, larger where nearer.
    pub fn screen(&self, [x, y, ahead]: Ahead) -> [f32; 3] {
        let (scale, near) = if self.perspective {
            (self.half / ahead, 1.0 / ahead)
        } else {
            (self.half, -ahead)
        };
        [
            0.5 * self.width as f32 + scale * x,
            0.5 * self.height as f32 - scale * y,
            near,
        ]
    }
}

/// A triangle in the picture.
pub(crate) struct Triangle {
    /// Corners in 16ths of a pixel.
    pub corners: [[i32; 2]; 3],
    /// How near it is at its first corner, and how that grows to the right and down, a 16th of a pixel.
    pub near: [f32; 3],
    /// Between these it is everywhere.
    pub range: [f32; 2],
    /// Which placed piece it is of, and which of its faces.
    pub placed: u32,
    pub face: u32,
    pub translucent: bool,
}

/// Triangles of some placed meshes, in their order, and which of them each tile may see.
pub(crate) struct Chunk {
    /// How many triangles the chunks before this one have.
    pub base: u32,
    pub triangles: Vec<Triangle>,
    /// Where the triangles of each tile begin in `list`; one more than tiles.
    starts: Vec<u32>,
    list: Vec<u32>,
}

impl Chunk {
    pub fn of_tile(&self, tile: usize) -> impl Iterator<Item = (u32, &Triangle)> {
        let list = &self.list[self.starts[tile] as usize..self.starts[tile + 1] as usize];
        list.iter()
            .map(|&index| (self.base + index, &self.triangles[index as usize]))
    }
}

/// The triangle of this number.
pub(crate) fn find(chunks: &[Chunk], number: u32) -> &Triangle {
    let chunk = chunks.partition_point(|chunk| chunk.base <= number) - 1;
    &chunks[chunk].triangles[(number - chunks[chunk].base) as usize]
}

/// Projects all meshes.
pub(crate) fn project(placed: &[Placed], lens: &Lens, threads: usize) -> Vec<Chunk> {
    let mut cuts = vec![0];
    let mut faces = 0;
    for (index, placed_mesh) in placed.iter().enumerate() {
        faces += placed_mesh.level().faces.len();
        if faces >= WORK || index + 1 == placed.len() {
            cuts.push(index + 1);
            faces = 0;
        }
    }
    let mut chunks = threads::map(threads, cuts.len() - 1, |work| {
        chunk(placed, cuts[work]..cuts[work + 1], lens)
    });
    let mut base = 0;
    for chunk in &mut chunks {
        chunk.base = base;
        base += chunk.triangles.len() as u32;
    }
    chunks
}

fn chunk(placed: &[Placed], range: std::ops::Range<usize>, lens: &Lens) -> Chunk {
    let mut triangles = Vec::new();
    let mut places = Vec::new();
    for index in range {
        let placed_mesh = &placed[index];
        let level = placed_mesh.level();
        places.clear();
        places.extend(level.vertices.iter().map(|&vertex| {
            let ahead = transformed(&placed_mesh.ahead, vertex);
            let free = !lens.perspective || is_free(&ahead, lens.nearest);
            (ahead, free.then(|| corner(lens, ahead)))
        }));
        let number = (index as u32, placed_mesh.translucent);
        // as seen from outside they run clockwise, since rows count downwards
        let turned = placed_mesh.closed && !placed_mesh.translucent;
        for (face, facet) in level.faces.iter().enumerate() {
            let at = facet.corners.map(|vertex| &places[vertex as usize]);
            let mut add = |corners: [Corner; 3]| {
                triangles.extend(triangle(lens, corners, turned, number, face as u32));
            };
            if let [Some(a), Some(b), Some(c)] = at.map(|(_, corner)| *corner) {
                add([a, b, c]);
                continue;
            }
            let polygon = clipped(at.map(|(ahead, _)| *ahead), lens.nearest);
            for fan in 2..polygon.len() {
                let ahead = [polygon[0], polygon[fan - 1], polygon[fan]];
                add(ahead.map(|ahead| corner(lens, ahead)));
            }
        }
    }
    sorted(triangles, lens)
}

pub(crate) fn transformed(rows: &[[f32; 4]; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| {
        let [a, b, c, d] = rows[k];
        a * x + b * y + c * z + d
    })
}

/// A corner in 16ths of a pixel, and how near it is.
#[derive(Clone, Copy)]
struct Corner {
    place: [i32; 2],
    near: f32,
}

fn corner(lens: &Lens, ahead: Ahead) -> Corner {
    let [x, y, near] = lens.screen(ahead);
    let whole = |pixels: f32| floor(pixels * SUB as f32 + 0.5);
    Corner {
        place: [whole(x), whole(y)],
        near,
    }
}

fn triangle(
    lens: &Lens,
    corners: [Corner; 3],
    turned: bool,
    (placed, translucent): (u32, bool),
    face: u32,
) -> Option<Triangle> {
    let [a, b, c] = corners.map(|corner| corner.place.map(i64::from));
    let near = corners.map(|corner| corner.near);
    let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
    let area = u[0] * v[1] - u[1] * v[0];
    if area == 0 || (turned && area > 0) {
        return None;
    }
    let outside = |axis: usize, size: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        high < 0 || low >= size as i64 * SUB
    };
    if outside(0, lens.width) || outside(1, lens.height) {
        return None;
    }
    let (first, second) = (near[1] - near[0], near[2] - near[0]);
    let [u, v] = [u, v].map(|edge| edge.map(|part| part as f32));
    let inverse = 1.0 / area as f32;
    Some(Triangle {
        corners: corners.map(|corner| corner.place),
        near: [
            near[0],
            (first * v[1] - second * u[1]) * inverse,
            (second * u[0] - first * v[0]) * inverse,
        ],
        range: [
            near[0].min(near[1]).min(near[2]),
            near[0].max(near[1]).max(near[2]),
        ],
        placed,
        face,
        translucent,
    })
}

/// Sorts triangles into the tiles that their boxes meet, in order.
fn sorted(triangles: Vec<Triangle>, lens: &Lens) -> Chunk {
    let (columns, rows) = (lens.columns(), lens.height.div_ceil(TILE));
    let side = TILE as i32 * SUB as i32;
    let tiles = |triangle: &Triangle, axis: usize, count: usize| {
        let [a, b, c] = triangle.corners.map(|corner| corner[axis]);
        let low = a.min(b).min(c).div_euclid(side).max(0);
        let high = a.max(b).max(c).div_euclid(side).min(count as i32 - 1);
        low as usize..(high + 1).max(0) as usize
    };
    let mut starts = vec![0_u32; columns * rows + 1];
    let each = |visit: &mut dyn FnMut(usize, u32)| {
        for (index, triangle) in triangles.iter().enumerate() {
            let wide = tiles(triangle, 0, columns);
            for row in tiles(triangle, 1, rows) {
                for column in wide.clone() {
                    visit(row * columns + column, index as u32);
                }
            }
        }
    };
    each(&mut |tile, _| starts[tile + 1] += 1);
    for tile in 0..columns * rows {
        starts[tile + 1] += starts[tile];
    }
    let mut list = vec![0; starts[columns * rows] as usize];
    let mut filled = starts.clone();
    each(&mut |tile, index| {
        list[filled[tile] as usize] = index;
        filled[tile] += 1;
    });
    Chunk {
        base: 0,
        triangles,
        starts,
        list,
    }
}
