//! Meshes that are kept, and pictures of them.

use crate::clip::NEAREST;
use crate::cover::SUB;
use crate::lamps::{Lamp, Lamps, caster};
use crate::marks::{Line, Mark};
use crate::mesh::{Mesh, Piece};
use crate::outlines::{self, Surface};
use crate::project::{Chunk, Lens, Placed, TILE, find, project};
use crate::rays::{Ray, Rays};
use crate::shade::{FILL, Ground, KEY, Light, Lights, Look, colour, light, mix};
use crate::shadow::Shadow;
use crate::tile::{FLOOR, NOBODY, SAMPLES, Seen, seen};
use crate::vector::{Vector, along, cross, dot, sub, unit};
use crate::view::View;
use crate::{Rgb, threads};

/// Sine of how high a light stands whose shadows on the floor are drawn: lower ones are longer than the picture.
const LOWEST: f64 = 0.05;
/// How far a vertex of a coarser mesh may be off [pixels].
const ERROR: f32 = 0.4;

/// A mesh at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Number of the mesh, as [`Renderer::add`] returned it.
    pub mesh: usize,
    /// Position [m], then the quaternion (x, y, z, w), of its frame in the world.
    pub pose: [f64; 7],
    /// Red, green, blue of a colour that is laid over it, and how much.
    pub tint: [u8; 4],
    /// From 0, not seen, to 1.
    pub opacity: f32,
}

/// What a picture shows, and from where.
#[derive(Clone, Debug)]
pub struct Shot<'a> {
    /// The camera, with the size of the picture. Lines and the floor need perspective.
    pub view: View,
    /// Meshes at their places.
    pub instances: &'a [Instance],
    /// Lines and dots on top, one over the other.
    pub lines: &'a [Line],
    /// Lights of the scene; without any, fixed ones shine.
    pub lamps: &'a [Lamp],
    /// Height of the floor and the distance of the lines on it [m].
    pub floor: Option<[f64; 2]>,
    /// What is behind everything, row by row from the top, and what the floor fades into; the sky if left out.
    pub backdrop: Option<&'a [Rgb]>,
    /// Whether dark lines part the meshes from each other and from what is behind.
    pub outlines: bool,
    /// What matters lies around here [m]: the floor fades beyond, and there are no shadows.
    pub middle: Vector,
    /// Within this distance [m].
    pub reach: f64,
}

/// Draws pictures of meshes that it keeps.
#[derive(Clone, Debug)]
pub struct Renderer {
    meshes: Vec<Mesh>,
    threads: usize,
}

impl Renderer {
    /// Without meshes yet; on up to so many threads.
    pub fn new(threads: usize) -> Renderer {
        Renderer {
            meshes: Vec::new(),
            threads: threads.max(1),
        }
    }

    /// Keeps a mesh, and returns its number.
    pub fn add(&mut self, mesh: Mesh) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// How many meshes there are.
    pub fn meshes(&self) -> usize {
        self.meshes.len()
    }

    /// A picture, row by row from the top.
    ///
    /// # Panics
    /// An instance names a mesh that is not there, or the backdrop has fewer pixels than the picture.
    pub fn render(&self, shot: &Shot) -> Vec<Rgb> {
        let view = &shot.view;
        let (width, height) = (view.width as usize, view.height as usize);
        let lens = Lens {
            width,
            height,
            half: 0.5 * width.max(height) as f32,
            perspective: view.perspective,
            nearest: (f64::from(NEAREST) * shot.reach) as f32,
        };
        // what a pixel-wide step is per metre ahead, over half the longer side
        let tangent = view.scale / (0.5 * view.width.max(view.height));
        let camera = [
            view.right.map(|part| part * tangent),
            view.up.map(|part| part * tangent),
            view.into,
        ];
        let stage = Stage::new(self, shot, &lens, camera);
        let chunks = project(&stage.placed, &lens, self.threads);
        let columns = lens.columns();
        let tiles = threads::map(self.threads, lens.tiles(), |tile| {
            let corner = [tile % columns * TILE, tile / columns * TILE];
            stage.tile(&chunks, tile, corner)
        });
        let size = [width, height];
        let mut pixels = joined(size, [0; 3], tiles.iter().map(|(colours, _)| &colours[..]));
        if shot.outlines {
            let tiles = tiles.iter().map(|(_, surfaces)| &surfaces[..]);
            let surfaces = joined(size, [Surface::NONE; 4], tiles);
            outlines::draw(&mut pixels, &surfaces, width);
        }
        pixels
    }
}

/// The pixels of a picture out of those of its tiles.
fn joined<'a, T: Copy + 'a>(
    [width, height]: [usize; 2],
    empty: T,
    tiles: impl Iterator<Item = &'a [T]>,
) -> Vec<T> {
    let columns = width.div_ceil(TILE);
    let mut pixels = vec![empty; width * height];
    for (tile, part) in tiles.enumerate() {
        let (left, top) = (tile % columns * TILE, tile / columns * TILE);
        let wide = TILE.min(width - left);
        for (row, part) in part.chunks_exact(TILE).enumerate().take(height - top) {
            let start = (top + row) * width + left;
            pixels[start..start + wide].copy_from_slice(&part[..wide]);
        }
    }
    pixels
}

/// All that the pixels of a picture are made of.
struct Stage<'a> {
    rays: Rays,
    width: usize,
    height: usize,
    backdrop: Option<&'a [Rgb]>,
    outlines: bool,
    placed: Vec<Placed<'a>>,
    looks: Vec<Look>,
    lights: Lights,
    marks: Vec<Mark>,
    /// How near the floor is: at the first pixel's corner, and how that grows to the right and down, a pixel.
    floor: Option<[f32; 3]>,
}

impl<'a> Stage<'a> {
    fn new(renderer: &'a Renderer, shot: &Shot<'a>, lens: &Lens, camera: [Vector; 3]) -> Stage<'a> {
        let view = shot.view;
        let caster = caster(shot.lamps, shot.middle);
        let key = caster.map_or_else(|| unit(KEY), |(_, towards)| towards);
        // the light's picture: a square around what matters, as seen along the light
        let side = match cross([0.0, 0.0, 1.0], key) {
            // straight from above, or from below
            side if dot(side, side) < 1e-12 => [1.0, 0.0, 0.0],
            side => unit(side),
        };
        let light_axes = [side, cross(key, side), key.map(|part| -part)];
        let centre = sub(shot.middle, view.eye);
        let scales = [1.0 / shot.reach, 1.0 / shot.reach, 1.0];
        let light_world: [[f64; 4]; 3] = std::array::from_fn(|k| {
            let axis = light_axes[k].map(|part| part * scales[k]);
            [axis[0], axis[1], axis[2], -dot(axis, centre)]
        });
        let camera_world = camera.map(|axis| [axis[0], axis[1], axis[2], 0.0]);
        let (mut placed, mut casters, mut looks) = (Vec::new(), Vec::new(), Vec::new());
        for instance in shot.instances {
            let mesh = &renderer.meshes[instance.mesh];
            let [x, y, z, ..] = instance.pose;
            let origin = sub([x, y, z], view.eye);
            let rotation = rotation(&instance.pose);
            let translucent = instance.opacity < 1.0 || mesh.translucent;
            let texel = (2.0 * shot.reach / crate::shadow::SIDE as f64) as f32;
            for piece in &mesh.pieces {
                let ball = centre_of(piece, &rotation, origin);
                let radius = f64::from(piece.radius);
                // the nearest of it decides how coarse it may be
                let nearest = match view.perspective {
                    true => (dot(ball, view.into) - radius).max(f64::from(lens.nearest)),
                    false => 1.0,
                };
                let pixel = (nearest / view.scale) as f32;
                let seen = |error: f32, world: &[[f64; 4]; 3], translucent: bool| Placed {
                    piece,
                    level: piece.level(error),
                    closed: mesh.closed,
                    look: looks.len() as u32,
                    ahead: composed(world, &rotation, origin),
                    translucent,
                };
                if !translucent && is_shading(&light_world, ball, radius) {
                    casters.push(seen(ERROR * texel, &light_world, false));
                }
                if instance.opacity > 0.0 && is_ahead(&view, ball, radius) {
                    placed.push(seen(ERROR * pixel, &camera_world, translucent));
                }
            }
            let [red, green, blue, tinted] = instance.tint;
            looks.push(Look {
                axes: std::array::from_fn(|axis| std::array::from_fn(|k| rotation[k][axis] as f32)),
                origin: origin.map(|part| part as f32),
                tint: light([red, green, blue]),
                tinted: f32::from(tinted) / 255.0,
                opacity: instance.opacity.clamp(0.0, 1.0),
            });
        }
        let shadow = Shadow::new(
            &casters,
            light_world.map(|row| row.map(|part| part as f32)),
            shot.reach as f32,
            shot.floor.map(|[height, _]| (height - view.eye[2]) as f32),
            renderer.threads,
        );
        let fill = (0..3).fold([0.0; 3], |sum, k| {
            let axis = [view.right, view.up, view.into][k];
            along(sum, FILL[k], axis)
        });
        let ground = shot.floor.and_then(|floor| ground(shot, floor));
        let ends = |ends: [Vector; 2]| {
            ends.map(|end| camera.map(|axis| dot(axis, sub(end, view.eye)) as f32))
        };
        Stage {
            rays: Rays::new(&view),
            width: lens.width,
            height: lens.height,
            backdrop: shot.backdrop,
            outlines: shot.outlines,
            placed,
            looks,
            floor: ground.as_ref().map(|ground| floor_near(&view, ground)),
            lights: Lights {
                key: key.map(|part| part as f32),
                fill: unit(fill).map(|part| part as f32),
                lamps: Lamps::new(shot.lamps, view.eye, caster.map(|(place, _)| place)),
                shadow,
                floor_shadows: (shot.lamps.is_empty() || caster.is_some()) && key[2] > LOWEST,
                ground,
            },
            marks: shot
                .lines
                .iter()
                .filter_map(|line| Mark::new(ends(line.ends), line.colour, line.width, lens))
                .collect(),
        }
    }

    /// The colours of a tile, row by row, and its surfaces where these are outlined.
    fn tile(
        &self,
        chunks: &[Chunk],
        tile: usize,
        corner: [usize; 2],
    ) -> (Vec<Rgb>, Vec<[Surface; 4]>) {
        let mut empty = Seen::new();
        if let Some([first, right, down]) = self.floor {
            for (pixel, near) in empty.near.iter_mut().enumerate() {
                let x = (corner[0] + pixel % TILE) as f32;
                let y = (corner[1] + pixel / TILE) as f32;
                for k in 0..4 {
                    let [aside, below] = SAMPLES[k].map(|part| part as f32 / SUB as f32);
                    let here = first + right * (x + aside) + down * (y + below);
                    if here > 0.0 {
                        near[k] = here;
                        empty.who[pixel][k] = FLOOR;
                    }
                }
            }
        }
        let (opaque, through) = seen(empty, chunks, tile, corner, &SAMPLES);
        let mut lights: Vec<Light> = (0..TILE * TILE)
            .map(|pixel| {
                let at = [corner[0] + pixel % TILE, corner[1] + pixel / TILE];
                let mut sum = [0.0; 3];
                for (who, samples, middle) in shares(&opaque.who[pixel]) {
                    let (light, _) = self.light(chunks, who, at, middle);
                    sum = std::array::from_fn(|k| sum[k] + samples * light[k]);
                }
                let Some(through) = &through else {
                    return sum;
                };
                let who: [u32; 4] = std::array::from_fn(|k| {
                    let before = through.near[pixel][k] > opaque.near[pixel][k];
                    if before {
                        through.who[pixel][k]
                    } else {
                        NOBODY
                    }
                });
                for (who, samples, middle) in shares(&who) {
                    if who != NOBODY {
                        let (light, opacity) = self.light(chunks, who, at, middle);
                        sum = mix(sum, light, samples * opacity);
                    }
                }
                sum
            })
            .collect();
        for mark in &self.marks {
            mark.draw(&mut lights, &opaque.near, corner);
        }
        let surfaces = match self.outlines {
            true => outlines::surfaces(&opaque, chunks, &self.placed),
            false => Vec::new(),
        };
        (lights.into_iter().map(colour).collect(), surfaces)
    }

    /// Light from what is seen at a place of a pixel, and its opacity.
    fn light(&self, chunks: &[Chunk], who: u32, at: [usize; 2], within: [f32; 2]) -> (Light, f32) {
        let [x, y] = [at[0] as f32 + within[0], at[1] as f32 + within[1]];
        match who {
            NOBODY => (self.behind(&self.rays.at(x, y), at), 1.0),
            FLOOR => {
                let ray = self.rays.at(x, y);
                let beside = [self.rays.at(x + 1.0, y), self.rays.at(x, y + 1.0)];
                let behind = || self.behind(&ray, at);
                let towards = beside.map(|ray| ray.towards);
                (self.lights.floor(ray.towards, towards, behind), 1.0)
            }
            number => {
                let triangle = find(chunks, number);
                let placed = triangle.placed as usize;
                let level = self.placed[placed].level();
                let face = &level.faces[triangle.face as usize];
                let vertices = face.corners.map(|vertex| level.vertices[vertex as usize]);
                let look = &self.looks[self.placed[placed].look as usize];
                self.lights
                    .surface(look, face, vertices, self.rays.at(x, y))
            }
        }
    }

    /// Light from behind everything at a pixel.
    fn behind(&self, ray: &Ray, [x, y]: [usize; 2]) -> Light {
        match self.backdrop {
            // tiles reach beyond the picture's lower right edges
            Some(pixels) if x < self.width && y < self.height => light(pixels[y * self.width + x]),
            _ => self.lights.sky(ray.towards),
        }
    }
}

/// Who is seen at the samples of a pixel: each once, with its share of them, and where they lie in the middle [pixels].
fn shares(who: &[u32; 4]) -> impl Iterator<Item = (u32, f32, [f32; 2])> {
    (0..4).filter_map(|first| {
        let id = who[first];
        if who[..first].contains(&id) {
            return None;
        }
        let (mut count, mut sum) = (0.0, [0.0; 2]);
        for k in first..4 {
            if who[k] == id {
                count += 1.0;
                sum = std::array::from_fn(|axis| sum[axis] + SAMPLES[k][axis] as f32);
            }
        }
        Some((
            id,
            0.25 * count,
            sum.map(|part| part / (count * SUB as f32)),
        ))
    })
}

/// Rows of the rotation of a pose, whose quaternion need not have length 1.
fn rotation(pose: &[f64; 7]) -> [Vector; 3] {
    let [.., x, y, z, w] = *pose;
    let square = x * x + y * y + z * z + w * w;
    if square == 0.0 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let s = 2.0 / square;
    [
        [
            1.0 - s * (y * y + z * z),
            s * (x * y - z * w),
            s * (x * z + y * w),
        ],
        [
            s * (x * y + z * w),
            1.0 - s * (x * x + z * z),
            s * (y * z - x * w),
        ],
        [
            s * (x * z - y * w),
            s * (y * z + x * w),
            1.0 - s * (x * x + y * y),
        ],
    ]
}

/// Where the ball around a piece of a mesh is, from the eye [m].
fn centre_of(piece: &Piece, rotation: &[Vector; 3], origin: Vector) -> Vector {
    let centre = piece.centre.map(f64::from);
    std::array::from_fn(|k| dot(rotation[k], centre) + origin[k])
}

/// Rows that take a mesh's frame to where other rows take the world.
fn composed(world: &[[f64; 4]; 3], rotation: &[Vector; 3], origin: Vector) -> [[f32; 4]; 3] {
    world.map(|[x, y, z, offset]| {
        let column =
            |axis: usize| x * rotation[0][axis] + y * rotation[1][axis] + z * rotation[2][axis];
        let moved = offset + dot([x, y, z], origin);
        [column(0), column(1), column(2), moved].map(|part| part as f32)
    })
}

/// Whether a ball may cast a shadow within the light's picture.
fn is_shading(rows: &[[f64; 4]; 3], ball: Vector, radius: f64) -> bool {
    rows[..2].iter().all(|[x, y, z, offset]| {
        let length = dot([*x, *y, *z], [*x, *y, *z]).sqrt();
        (dot([*x, *y, *z], ball) + offset).abs() <= 1.0 + radius * length
    })
}

/// Whether a ball may be seen.
fn is_ahead(view: &View, ball: Vector, radius: f64) -> bool {
    let ahead = dot(ball, view.into);
    let within = |axis: Vector, half: f64| {
        let aside = dot(ball, axis).abs();
        if !view.perspective {
            return aside <= half / view.scale + radius;
        }
        // the edge of the picture is a plane through the eye
        let tangent = half / view.scale;
        aside - tangent * ahead <= radius * (1.0 + tangent * tangent).sqrt()
    };
    let is_before = !view.perspective || ahead > -radius;
    is_before && within(view.right, 0.5 * view.width) && within(view.up, 0.5 * view.height)
}

fn ground(shot: &Shot, [height, spacing]: [f64; 2]) -> Option<Ground> {
    let eye = shot.view.eye;
    let lines = [eye[0] / spacing, eye[1] / spacing];
    let whole = lines.map(f64::round);
    (height < eye[2]).then(|| Ground {
        height: (height - eye[2]) as f32,
        spacing: spacing as f32,
        eye: std::array::from_fn(|axis| (lines[axis] - whole[axis]) as f32),
        lines: whole.map(|line| line as f32),
        middle: std::array::from_fn(|axis| (shot.middle[axis] - eye[axis]) as f32),
        reach: shot.reach as f32,
    })
}

/// 1 over the distance ahead is z of the ray over the floor's height, and a ray grows evenly over the picture.
fn floor_near(view: &View, ground: &Ground) -> [f32; 3] {
    let height = f64::from(ground.height);
    let (right, down) = (view.right[2] / view.scale, -view.up[2] / view.scale);
    let first = view.into[2] - 0.5 * view.width * right - 0.5 * view.height * down;
    [first, right, down].map(|part| (part / height) as f32)
}
