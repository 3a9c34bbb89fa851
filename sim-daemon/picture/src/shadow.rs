//! Soft shadows of the key light, from a small picture of the scene as the light sees it.
//!
//! The light is a disc. A shadow is sharp where things touch and wide far from what casts it (percentage-closer soft
//! shadows, Fernando 2005): how far what blocks the light is on average gives the width of the penumbra, and the share of
//! the texels within this width that are nearer to the light gives the shadow. Texels are compared with the plane of the
//! surface, not with one depth, so that a flat surface does not shadow itself.

use crate::cover::floor;
use crate::project::{Chunk, Lens, Placed, TILE, project, transformed};
use crate::threads;
use crate::tile::{MIDDLE, Seen, seen};

/// Texels along a side.
pub(crate) const SIDE: usize = 1024;
/// Radius of the light as seen from the scene, its tangent: as of a window, not of the sun.
pub(crate) const LIGHT: f32 = 0.05;
/// Texels along a side of the square around a point that is looked at.
const WINDOW: usize = 8;
/// Maps, each with half the texels a side of the one before.
const LEVELS: usize = 5;
/// Half the width of a penumbra [texels]: the least hides the texels, the most fills the coarsest map's window.
const RADIUS: [f32; 2] = [1.8, ((WINDOW / 2) << (LEVELS - 1)) as f32];
/// Texels along a side of a block whose tallest blocker is known.
const BLOCK: usize = 16;
/// Texels along the rim in which shadows fade: the picture goes on beyond the light's square.
const FADE: f32 = 64.0;
/// Steepest surface whose plane is followed [texels of depth a texel].
const STEEPEST: f32 = 6.0;

/// A square of numbers, with a rim that blocks no light.
struct Map {
    stride: usize,
    texels: Vec<f32>,
}

impl Map {
    const RIM: usize = WINDOW / 2;

    fn new(side: usize) -> Map {
        let stride = side + 2 * Map::RIM;
        let texels = vec![f32::NEG_INFINITY; stride * stride];
        Map { stride, texels }
    }

    fn side(&self) -> usize {
        self.stride - 2 * Map::RIM
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.texels[(row + Map::RIM) * self.stride + Map::RIM..][..self.side()]
    }

    fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let side = self.side();
        &mut self.texels[(row + Map::RIM) * self.stride + Map::RIM..][..side]
    }

    /// Every second texel of every second row.
    fn halved(&self) -> Map {
        let mut half = Map::new(self.side() / 2);
        for row in 0..half.side() {
            let every = self.row(2 * row).iter().step_by(2);
            for (texel, &from) in half.row_mut(row).iter_mut().zip(every) {
                *texel = from;
            }
        }
        half
    }

    /// The largest of each square of texels, where each row is raised by so much more than the one above.
    fn largest(&self, block: usize, raise: f32) -> Map {
        let mut map = Map::new(self.side() / block);
        let mut line = vec![0.0; self.side()];
        for row in 0..map.side() {
            line.fill(f32::NEG_INFINITY);
            for within in row * block..(row + 1) * block {
                let raise = raise * within as f32;
                for (most, &texel) in line.iter_mut().zip(self.row(within)) {
                    *most = most.max(texel + raise);
                }
            }
            for (texel, line) in map.row_mut(row).iter_mut().zip(line.chunks_exact(block)) {
                *texel = line.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            }
        }
        map
    }

    /// The largest within so many texels of each.
    fn spread(&self, reach: usize) -> Map {
        let side = self.side();
        let around = |at: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
        let mut map = Map::new(side);
        for row in 0..side {
            for column in 0..side {
                let near = around(row).flat_map(|row| &self.row(row)[around(column)]);
                map.row_mut(row)[column] = near.copied().fold(f32::NEG_INFINITY, f32::max);
            }
        }
        map
    }

    /// What is above a plane around its place: the sum of weights, the sum of weighted heights, and all weights.
    #[inline(always)]
    fn above(&self, plane: &Plane, radius: f32) -> [f32; 3] {
        let rim = (Map::RIM + 1 - WINDOW / 2) as i32;
        let last = (self.stride - WINDOW) as i32;
        let before = plane.place.map(floor);
        let [left, top] = before.map(|before| (before + rim).clamp(0, last) as usize);
        let [right, down] =
            [0, 1].map(|axis| (before[axis] - (WINDOW / 2 - 1) as i32) as f32 - plane.place[axis]);
        let inverse = 1.0 / radius;
        let weights = |from: f32| -> [f32; WINDOW] {
            std::array::from_fn(|k| {
                let t = (from + k as f32) * inverse;
                (1.0 - t * t).max(0.0)
            })
        };
        let (across, along) = (weights(right), weights(down));
        let [slope, fall] = plane.slope;
        let start = plane.near + fall * down;
        let mut line: [f32; WINDOW] = std::array::from_fn(|k| start + slope * (right + k as f32));
        let (mut count, mut heights) = ([0.0_f32; WINDOW], [0.0_f32; WINDOW]);
        for (row, weight) in along.into_iter().enumerate() {
            let texels = &self.texels[(top + row) * self.stride + left..][..WINDOW];
            for k in 0..WINDOW {
                let height = larger(texels[k] - line[k], 0.0);
                let share = if height > 0.0 {
                    weight * across[k]
                } else {
                    0.0
                };
                count[k] += share;
                heights[k] += share * height;
                line[k] += fall;
            }
        }
        let sum = |of: &[f32; WINDOW]| of.iter().sum::<f32>();
        [sum(&count), sum(&heights), sum(&across) * sum(&along)]
    }
}

/// The plane of a surface as the light sees it: a place [texels], how near it is there, and how that grows to the right
/// and down [m a texel].
#[derive(Clone, Copy)]
struct Plane {
    place: [f32; 2],
    near: f32,
    slope: [f32; 2],
}

impl Plane {
    /// In a map with so many times the texels' width, whose first texel's middle is here.
    fn coarser(self, scale: f32, first: f32) -> Plane {
        Plane {
            place: self.place.map(|place| (place - first) / scale),
            near: self.near,
            slope: self.slope.map(|slope| slope * scale),
        }
    }

    fn steepness(&self) -> f32 {
        self.slope[0].abs() + self.slope[1].abs()
    }
}

/// How near to the light the nearest surface is, texel by texel.
pub(crate) struct Shadow {
    /// From the world, relative to the picture's eye, to texels and `near`: rows of a matrix, the translation last.
    rows: [[f32; 4]; 3],
    /// Unit vectors of the light: to the right, down, towards it.
    axes: [[f32; 3]; 3],
    /// Width of a texel [m].
    texel: f32,
    /// Every texel, every second, every fourth …
    levels: Vec<Map>,
    /// How near a level plane is from row to row [m]; less this, `near` is the height along the light.
    fall: f32,
    /// How far blockers are searched for [texels], and the level of the map in which they are.
    search: f32,
    level: usize,
    /// The largest height of the texels that are one in that level.
    highest: Map,
    /// The largest height within the search of any texel of a block.
    bound: Map,
}

impl Shadow {
    /// Of meshes as a light sees them that looks at a square of this half width [m]; `floor` is the height below the eye
    /// of what lies below them [m].
    pub fn new(
        placed: &[Placed],
        world: [[f32; 4]; 3],
        half: f32,
        floor: Option<f32>,
        threads: usize,
    ) -> Shadow {
        let lens = Lens {
            width: SIDE,
            height: SIDE,
            half: 0.5 * SIDE as f32,
            perspective: false,
            nearest: 0.0,
        };
        let near = map(placed, &lens, threads);
        // as `Lens::screen` without perspective
        let scale = 0.5 * SIDE as f32;
        let [x, y, z] = world;
        let rows = [
            [
                scale * x[0],
                scale * x[1],
                scale * x[2],
                scale * x[3] + scale,
            ],
            [
                -scale * y[0],
                -scale * y[1],
                -scale * y[2],
                scale - scale * y[3],
            ],
            z.map(|part| -part),
        ];
        let texel = 2.0 * half / SIDE as f32;
        let axis = |row: usize, scale: f32| std::array::from_fn(|k| rows[row][k] * scale);
        let axes: [[f32; 3]; 3] = [axis(0, texel), axis(1, texel), axis(2, 1.0)];
        let fall = slope(&axes, [0.0, 0.0, 1.0], texel)[1];
        let blocks = near.largest(BLOCK, -fall);
        let levelled = |near: f32, row: f32| near - fall * row;
        let all = (0..blocks.side()).flat_map(|row| blocks.row(row).iter().copied());
        let high = all.clone().fold(f32::NEG_INFINITY, f32::max);
        let below = floor.map(|floor| {
            let [_, row, near] = transformed(&rows, [0.0, 0.0, floor]);
            levelled(near, row - 0.5)
        });
        let finite = all.filter(|near| near.is_finite());
        let low = below.unwrap_or_else(|| finite.fold(f32::INFINITY, f32::min));
        let height = if high > low { high - low } else { 0.0 };
        let search = (LIGHT * height / texel).clamp(RADIUS[0], RADIUS[1]);
        let level = level_of(search).max(1);
        let mut levels = vec![near];
        for level in 1..LEVELS {
            levels.push(levels[level - 1].halved());
        }
        Shadow {
            rows,
            axes,
            texel,
            search,
            level,
            highest: levels[0].largest(1 << level, -fall),
            fall,
            bound: blocks.spread((search / BLOCK as f32).ceil() as usize),
            levels,
        }
    }

    /// Which part of the light reaches a point of a surface with this normal, given relative to the picture's eye.
    pub fn light(&self, point: [f32; 3], normal: [f32; 3]) -> f32 {
        let [x, y, near] = transformed(&self.rows, point);
        let place = [x - 0.5, y - 0.5];
        let last = (SIDE - 1) as f32;
        // 0 beside the square, and where a place is not finite
        let within = place.map(|place| larger(place.min(last - place), 0.0));
        let share = (within[0].min(within[1]) / FADE).min(1.0);
        if share <= 0.0 {
            return 1.0;
        }
        let mut plane = Plane {
            place,
            near,
            slope: slope(&self.axes, normal, self.texel),
        };
        // casters are coarser meshes, half a texel off
        plane.near += self.texel + 0.5 * plane.steepness();
        let level = Plane {
            near: plane.near - self.fall * place[1],
            slope: [plane.slope[0], plane.slope[1] - self.fall],
            place,
        };
        let tilt = level.steepness();
        let [column, row] = place.map(|place| (place + 0.5) as usize / BLOCK);
        if self.bound.row(row)[column] <= level.near - tilt * (self.search + 1.0) {
            return 1.0;
        }
        let scale = (1 << self.level) as f32;
        let first = 0.5 * (scale - 1.0);
        let mut searched = level.coarser(scale, first);
        // one texel has the largest of several
        searched.near += first * tilt;
        let [count, heights, _] = self.highest.above(&searched, self.search / scale);
        if count == 0.0 && tilt < 1e-3 * self.texel {
            return 1.0;
        }
        let distance = if count > 0.0 { heights / count } else { 0.0 };
        let radius = (LIGHT * distance / self.texel).clamp(RADIUS[0], self.search);
        let level = level_of(radius);
        let scale = (1 << level) as f32;
        let [count, _, all] = self.levels[level].above(&plane.coarser(scale, 0.0), radius / scale);
        1.0 - share * count / all
    }
}

/// A single instruction, unlike `max`, which cares for what is no number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// How much nearer to the light a surface is a texel to the right, and a texel down [m].
fn slope([right, down, key]: &[[f32; 3]; 3], normal: [f32; 3], texel: f32) -> [f32; 2] {
    let dot = |a: &[f32; 3]| a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2];
    let scale = -texel / dot(key).max(1e-6);
    let most = STEEPEST * texel;
    [right, down].map(|axis| (scale * dot(axis)).clamp(-most, most))
}

/// The finest map in which a window holds this radius [texels].
fn level_of(radius: f32) -> usize {
    let levels = (0..LEVELS - 1).take_while(|level| radius > ((WINDOW / 2) << level) as f32);
    levels.count()
}

/// How near to the light the nearest surface is, texel by texel.
fn map(placed: &[Placed], lens: &Lens, threads: usize) -> Map {
    let chunks = project(placed, lens, threads);
    let columns = lens.columns();
    let tiles = threads::map(threads, lens.tiles(), |tile| {
        let corner = [tile % columns * TILE, tile / columns * TILE];
        is_met(&chunks, tile).then(|| seen(Seen::new(), &chunks, tile, corner, &MIDDLE).0.near)
    });
    let mut near = Map::new(SIDE);
    for (tile, texels) in tiles.iter().enumerate() {
        let (top, left) = (tile / columns * TILE, tile % columns * TILE);
        for (row, texels) in texels.iter().flat_map(|t| t.chunks_exact(TILE)).enumerate() {
            near.row_mut(top + row)[left..left + TILE].copy_from_slice(texels.as_flattened());
        }
    }
    near
}

fn is_met(chunks: &[Chunk], tile: usize) -> bool {
    chunks
        .iter()
        .any(|chunk| chunk.of_tile(tile).next().is_some())
}

const _: () = assert!(SIDE.is_multiple_of(TILE) && SIDE.is_multiple_of(BLOCK));
const _: () = assert!(SIDE >> (LEVELS - 1) >= WINDOW);
