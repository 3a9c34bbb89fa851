//! The shapes of all links as meshes that sim-picture draws.

use sim_model::Pose;
use sim_model::geometry::TriMesh;
use sim_picture::vector::{Vector, dot, extent, middle, sub};
use sim_picture::{Instance, Mesh, Renderer, Shot, View};

use super::canvas::{Canvas, Rgb};

/// Colour that is laid over a mesh: none.
const NO_TINT: [u8; 4] = [0; 4];

/// All shapes of a robot.
#[derive(Clone, Debug)]
pub(super) struct Solids {
    renderer: Renderer,
    instances: Vec<Instance>,
    /// Lowest and highest coordinates of the robot [m].
    pub extent: [Vector; 2],
    /// Vertices of the robot in the world [m].
    pub points: Vec<Vector>,
}

impl Solids {
    /// The shapes of a robot and those around it (number of the link, frame of the shape in the world, its triangles), and
    /// a colour a link.
    pub fn new(
        shapes: &[(u32, Pose, TriMesh)],
        around: &[(u32, Pose, TriMesh)],
        colours: &[Rgb],
    ) -> Solids {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut renderer = Renderer::new(threads);
        let mut points = Vec::with_capacity(shapes.iter().map(|s| s.2.vertices.len()).sum());
        for (_, frame, triangles) in shapes {
            let rows = frame.rotation();
            points.extend(triangles.vertices.iter().map(|&vertex| {
                let place = |axis: usize| dot(rows[axis], vertex) + frame.pos[axis];
                std::array::from_fn(place)
            }));
        }
        let mut instances = Vec::with_capacity(shapes.len() + around.len());
        for (link, frame, triangles) in shapes.iter().chain(around) {
            let ([x, y, z], [a, b, c, d]) = (frame.pos, frame.quat);
            instances.push(Instance {
                mesh: renderer.add(mesh(triangles, colours[*link as usize])),
                pose: [x, y, z, a, b, c, d],
                tint: NO_TINT,
                opacity: 1.0,
            });
        }
        Solids {
            renderer,
            instances,
            extent: extent(points.iter().copied()),
            points,
        }
    }

    /// Length of the diagonal of the extent, 1 m if it has none [m].
    pub fn size(&self) -> f64 {
        let [low, high] = self.extent;
        let diagonal = sub(high, low);
        let size = dot(diagonal, diagonal).sqrt();
        if size > 0.0 { size } else { 1.0 }
    }

    /// A picture of them over a backdrop, on a floor at a height with lines so far apart [m], if there is one.
    pub fn render(&self, view: &View, floor: Option<[f64; 2]>, backdrop: &Canvas) -> Canvas {
        let shot = Shot {
            view: *view,
            instances: &self.instances,
            lines: &[],
            lamps: &[],
            floor,
            backdrop: Some(&backdrop.pixels),
            outlines: true,
            middle: middle(self.extent),
            reach: 0.5 * self.size(),
        };
        Canvas {
            pixels: self.renderer.render(&shot),
            ..*backdrop
        }
    }
}

fn mesh(triangles: &TriMesh, [red, green, blue]: Rgb) -> Mesh {
    let single = |vertex: &Vector| vertex.map(|part| part as f32);
    let vertices: Vec<[f32; 3]> = triangles.vertices.iter().map(single).collect();
    let colours = vec![[red, green, blue, 255]; triangles.triangles.len()];
    Mesh::new(&vertices, &triangles.triangles, &colours)
        .expect("shapes of a model are finite, and their triangles name vertices that are there")
}
