//! Builds a tree: halves by the surface area heuristic, then eight children for each node.

use sim_model::geometry::vector::{Vector as Point, cross, dot, sub};

use super::{LEAF, Leaf, Node, PartTree, STACK, Tree};
use crate::vector::Vector;

/// Triangles of a leaf.
const WIDTH: usize = 8;
/// Places of a split that are tried along each axis.
const BINS: usize = 16;
/// Levels after which halves have as many triangles each.
const DEEP: usize = 20;
// numbers of 32 bits: from there, 28 halvings lead to a leaf
const _: () = assert!((DEEP + 28 + 1) * (WIDTH - 1) < STACK);
/// By how much boxes are larger than what they hold, relative to its coordinates: more than the rounding of their corners.
const MARGIN: f64 = 1e-6;

/// A box.
#[derive(Clone, Copy)]
struct Bounds {
    low: Point,
    high: Point,
}

impl Bounds {
    const EMPTY: Bounds = Bounds {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    fn with(&self, other: &Bounds) -> Bounds {
        Bounds {
            low: [0, 1, 2].map(|k| self.low[k].min(other.low[k])),
            high: [0, 1, 2].map(|k| self.high[k].max(other.high[k])),
        }
    }

    /// Half of the surface; 0 where nothing is inside.
    fn area(&self) -> f64 {
        let [x, y, z] = [0, 1, 2].map(|k| (self.high[k] - self.low[k]).max(0.0));
        x * y + y * z + z * x
    }
}

/// A triangle that is to be placed.
#[derive(Clone, Copy)]
struct Item {
    bounds: Bounds,
    center: Point,
    number: usize,
}

/// A tree of halves.
enum Half {
    Leaf(Bounds, Vec<usize>),
    Inner(Bounds, Box<[Half; 2]>),
}

impl Half {
    fn bounds(&self) -> &Bounds {
        match self {
            Half::Leaf(bounds, _) | Half::Inner(bounds, _) => bounds,
        }
    }
}

impl Tree {
    /// The tree of triangles whose corners run counter-clockwise from their front, about the centre of their box, which is
    /// returned as well [m], in single precision. Triangles without area are left out.
    pub(crate) fn new(triangles: &[[Point; 3]]) -> (Tree, Vector) {
        let all = bounds_of(triangles.as_flattened());
        let center = match triangles.is_empty() {
            true => [0.0; 3],
            false => [0, 1, 2].map(|k| (0.5 * (all.low[k] + all.high[k])) as f32),
        };
        let about = center.map(f64::from);
        let moved: Vec<[Point; 3]> = triangles
            .iter()
            .map(|corners| corners.map(|corner| [0, 1, 2].map(|k| corner[k] - about[k])))
            .collect();
        let mut items: Vec<Item> = moved
            .iter()
            .enumerate()
            .filter_map(|(number, corners)| item(number, corners))
            .collect();
        let mut tree = Tree {
            nodes: Vec::new(),
            leaves: Vec::new(),
            half: [0, 1, 2]
                .map(|k| (all.high[k] - about[k]).max(about[k] - all.low[k]))
                .map(|half| ((1.0 + MARGIN) * half.max(0.0)) as f32),
        };
        let grown = Grown::new(&mut items);
        tree.nodes = grown.nodes;
        tree.leaves = grown.leaves.iter().map(|all| leaf(all, &moved)).collect();
        (tree, center)
    }
}

impl PartTree {
    /// The tree of boxes, by their lowest and highest corners [m].
    pub(crate) fn new(boxes: &[[Point; 2]]) -> PartTree {
        let items = boxes.iter().enumerate().map(|(number, &[low, high])| Item {
            bounds: Bounds { low, high },
            center: [0, 1, 2].map(|k| 0.5 * (low[k] + high[k])),
            number,
        });
        let grown = Grown::new(&mut items.collect::<Vec<Item>>());
        let reach = boxes.iter().flatten().flatten().map(|x| x.abs());
        PartTree {
            nodes: grown.nodes,
            leaves: grown.leaves,
            reach: reach.fold(0.0, f64::max) as f32,
        }
    }
}

/// Nodes, and the numbers of what is in each leaf.
#[derive(Default)]
struct Grown {
    nodes: Vec<Node>,
    leaves: Vec<Vec<usize>>,
}

impl Grown {
    fn new(items: &mut [Item]) -> Grown {
        let mut grown = Grown::default();
        if !items.is_empty() {
            let root = halve(items, 0);
            grown.add(root);
        }
        grown
    }

    /// Adds a node with all below; returns its place.
    fn add(&mut self, half: Half) -> u32 {
        let mut children = vec![half];
        // opens the child with the largest surface, as long as there is room
        while children.len() < WIDTH {
            let area = |child: &Half| match child {
                Half::Leaf(..) => -1.0,
                Half::Inner(bounds, _) => bounds.area(),
            };
            let largest = (0..children.len())
                .max_by(|&a, &b| area(&children[a]).total_cmp(&area(&children[b])));
            match largest.map(|largest| children.swap_remove(largest)) {
                Some(Half::Inner(_, halves)) => children.extend(*halves),
                leaf => {
                    children.extend(leaf);
                    break;
                }
            }
        }
        let place = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (lane, child) in children.into_iter().enumerate() {
            let bounds = *child.bounds();
            let at = match child {
                Half::Leaf(_, numbers) => {
                    self.leaves.push(numbers);
                    LEAF | (self.leaves.len() - 1) as u32
                }
                inner @ Half::Inner(..) => self.add(inner),
            };
            let node = &mut self.nodes[place];
            for k in 0..3 {
                let margin = MARGIN * bounds.low[k].abs().max(bounds.high[k].abs());
                node.low[k][lane] = (bounds.low[k] - margin) as f32;
                node.high[k][lane] = (bounds.high[k] + margin) as f32;
            }
            node.children[lane] = at;
        }
        place as u32
    }
}

impl Node {
    /// No ray meets a box that ends before it begins.
    const EMPTY: Node = Node {
        low: [[f32::INFINITY; 8]; 3],
        high: [[f32::NEG_INFINITY; 8]; 3],
        children: [0; 8],
    };
}

fn bounds_of(points: &[Point]) -> Bounds {
    let points = points.iter().map(|&point| Bounds {
        low: point,
        high: point,
    });
    points.fold(Bounds::EMPTY, |all, point| all.with(&point))
}

fn item(number: usize, corners: &[Point; 3]) -> Option<Item> {
    let bounds = bounds_of(corners);
    let normal = cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]));
    let is_flat = dot(normal, normal) > 0.0 && normal.iter().all(|x| x.is_finite());
    is_flat.then(|| Item {
        bounds,
        center: [0, 1, 2].map(|k| 0.5 * (bounds.low[k] + bounds.high[k])),
        number,
    })
}

fn halve(items: &mut [Item], depth: usize) -> Half {
    let bounds = items
        .iter()
        .fold(Bounds::EMPTY, |all, item| all.with(&item.bounds));
    if items.len() <= WIDTH {
        return Half::Leaf(bounds, items.iter().map(|item| item.number).collect());
    }
    let middle = match split(items, depth) {
        Some((axis, place)) => partition(items, |item| item.center[axis] < place),
        None => {
            let axis = widest(items);
            let middle = items.len() / 2;
            items.select_nth_unstable_by(middle, |a, b| {
                a.center[axis]
                    .total_cmp(&b.center[axis])
                    .then(a.number.cmp(&b.number))
            });
            middle
        }
    };
    let (low, high) = items.split_at_mut(middle);
    Half::Inner(
        bounds,
        Box::new([halve(low, depth + 1), halve(high, depth + 1)]),
    )
}

/// Bounds of the centres.
fn spread(items: &[Item]) -> Bounds {
    let points = items.iter().map(|item| Bounds {
        low: item.center,
        high: item.center,
    });
    points.fold(Bounds::EMPTY, |all, point| all.with(&point))
}

fn widest(items: &[Item]) -> usize {
    let spread = spread(items);
    let width = |k: usize| spread.high[k] - spread.low[k];
    (0..3)
        .max_by(|&a, &b| width(a).total_cmp(&width(b)))
        .unwrap_or(0)
}

/// Axis and place of the split that costs rays least; none where halves of as many triangles are taken.
fn split(items: &[Item], depth: usize) -> Option<(usize, f64)> {
    if depth >= DEEP {
        return None;
    }
    let spread = spread(items);
    let mut best: Option<(f64, usize, f64)> = None;
    for axis in 0..3 {
        let (low, width) = (spread.low[axis], spread.high[axis] - spread.low[axis]);
        let place = |bin: usize| low + width * bin as f64 / BINS as f64;
        if width <= 0.0 {
            continue;
        }
        let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
        for item in items {
            // by the same comparison as in the split itself
            let guess = ((item.center[axis] - low) / width * BINS as f64) as usize;
            let bin = (guess.saturating_sub(1)..BINS)
                .rfind(|&bin| item.center[axis] >= place(bin))
                .unwrap_or(0);
            bins[bin] = (bins[bin].0.with(&item.bounds), bins[bin].1 + 1);
        }
        for bin in 1..BINS {
            let sum = |bins: &[(Bounds, usize)]| {
                let (bounds, count) = bins.iter().fold((Bounds::EMPTY, 0), |all, bin| {
                    (all.0.with(&bin.0), all.1 + bin.1)
                });
                (bounds.area() * count.div_ceil(WIDTH) as f64, count)
            };
            let ((low_cost, low_count), (high_cost, high_count)) =
                (sum(&bins[..bin]), sum(&bins[bin..]));
            let cost = low_cost + high_cost;
            if low_count > 0 && high_count > 0 && best.is_none_or(|best| cost < best.0) {
                best = Some((cost, axis, place(bin)));
            }
        }
    }
    best.map(|(_, axis, place)| (axis, place))
}

/// Puts what is in the first half first, in order; returns how many.
fn partition(items: &mut [Item], is_first: impl Fn(&Item) -> bool) -> usize {
    items.sort_by_key(|item| !is_first(item));
    items.partition_point(is_first)
}

fn leaf(numbers: &[usize], triangles: &[[Point; 3]]) -> Leaf {
    let mut leaf = Leaf {
        // a ray meets no triangle that has no normal
        normal: [[0.0; 8]; 3],
        height: [0.0; 8],
        across: [[[0.0; 8]; 3]; 2],
        start: [[0.0; 8]; 2],
        steep: [0.0; 8],
        number: [0; 8],
    };
    for (lane, &number) in numbers.iter().enumerate() {
        let [a, b, c] = triangles[number];
        let edges = [sub(b, a), sub(c, a)];
        let normal = cross(edges[0], edges[1]);
        let square = dot(normal, normal);
        let unit = normal.map(|x| x / square.sqrt());
        // u grows along the first edge and not along the second
        let across =
            [cross(edges[1], normal), cross(normal, edges[0])].map(|v| v.map(|x| x / square));
        let both = [0, 1, 2].map(|k| across[0][k] + across[1][k]);
        let steep = [across[0], across[1], both].map(|v| dot(v, v).sqrt());
        for k in 0..3 {
            leaf.normal[k][lane] = unit[k] as f32;
            leaf.across[0][k][lane] = across[0][k] as f32;
            leaf.across[1][k][lane] = across[1][k] as f32;
        }
        leaf.height[lane] = dot(unit, a) as f32;
        leaf.start[0][lane] = -dot(across[0], a) as f32;
        leaf.start[1][lane] = -dot(across[1], a) as f32;
        leaf.steep[lane] = steep.into_iter().fold(0.0, f64::max) as f32;
        leaf.number[lane] = number as u32;
    }
    leaf
}
