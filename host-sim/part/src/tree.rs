//! A tree of boxes over anything that has one.

use glam::DVec3;

/// Largest number of items in a leaf.
const LEAF: usize = 4;
/// Most nodes that wait: a tree halved at the median of four thousand million items is 32 deep.
const DEPTH: usize = 64;

/// A box with sides along the axes, mm.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Least corner.
    pub low: DVec3,
    /// Greatest corner.
    pub high: DVec3,
}

impl Block {
    /// Around nothing.
    pub const NONE: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    /// Around points.
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::NONE, |around, point| Self {
            low: around.low.min(point),
            high: around.high.max(point),
        })
    }

    /// Grown on all sides.
    #[must_use]
    pub fn grown(self, by: f64) -> Self {
        Self {
            low: self.low - by,
            high: self.high + by,
        }
    }

    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Square of the distance of a point.
    #[must_use]
    pub fn distance_squared(&self, to: DVec3) -> f64 {
        (self.low - to)
            .max(to - self.high)
            .max(DVec3::ZERO)
            .length_squared()
    }

    /// Square of the distance of the part of the box between two heights from a vertical line through a point; infinite where there is no such part.
    #[must_use]
    pub fn beside_squared(&self, to: DVec3, z: [f64; 2]) -> f64 {
        if self.high.z < z[0] || self.low.z > z[1] {
            return f64::INFINITY;
        }
        let gap = (self.low - to).max(to - self.high).max(DVec3::ZERO);
        gap.x * gap.x + gap.y * gap.y
    }
}

#[derive(Clone, Debug)]
struct Node {
    block: Block,
    /// First item of a leaf, or the second child; the first child follows its parent.
    at: u32,
    /// Items of a leaf; 0 for an inner node.
    count: u32,
}

/// The tree. Items are known by their number.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    items: Vec<u32>,
}

impl Tree {
    /// Over the boxes of items.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "fewer than 2^32 items")]
    pub(crate) fn new(blocks: &[Block]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(blocks.len()),
            items: (0..blocks.len() as u32).collect(),
        };
        if blocks.is_empty() {
            return tree;
        }
        let mut items = std::mem::take(&mut tree.items);
        tree.split(blocks, &mut items, 0);
        tree.items = items;
        tree
    }

    #[allow(clippy::cast_possible_truncation, reason = "fewer than 2^32 items")]
    fn split(&mut self, blocks: &[Block], items: &mut [u32], first: usize) {
        let of = |item: &u32| blocks[*item as usize];
        let block = items.iter().map(of).fold(Block::NONE, Block::with);
        let node = self.nodes.len();
        self.nodes.push(Node {
            block,
            at: first as u32,
            count: items.len() as u32,
        });
        if items.len() <= LEAF {
            return;
        }
        let middle = |item: &u32| 0.5 * (of(item).low + of(item).high);
        let spread = Block::around(items.iter().map(middle));
        let size = (spread.high - spread.low).to_array();
        let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(0);
        let half = items.len() / 2;
        items.select_nth_unstable_by(half, |a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
        let (low, high) = items.split_at_mut(half);
        self.split(blocks, low, first);
        self.nodes[node].at = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(blocks, high, first + half);
    }

    /// Visits the items of all boxes whose squared distance is below that of the bound, the nearer boxes first. `visit` may lower the bound.
    pub(crate) fn nearest(
        &self,
        bound: &mut f64,
        distance_squared: impl Fn(&Block) -> f64,
        mut visit: impl FnMut(usize, &mut f64),
    ) {
        let square = |bound: f64| bound.max(0.0) * bound;
        let mut open = [(0_u32, 0.0_f64); DEPTH];
        let mut count = 0;
        if let Some(root) = self.nodes.first() {
            open[0] = (0, distance_squared(&root.block));
            count = 1;
        }
        while count > 0 {
            count -= 1;
            let (index, far) = open[count];
            if far >= square(*bound) {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                let first = node.at as usize;
                for item in &self.items[first..first + node.count as usize] {
                    visit(*item as usize, bound);
                }
                continue;
            }
            let mut children = [index + 1, node.at]
                .map(|child| (child, distance_squared(&self.nodes[child as usize].block)));
            if children[0].1 < children[1].1 {
                children.swap(0, 1);
            }
            let square = square(*bound);
            for child in children {
                if child.1 < square {
                    open[count] = child;
                    count += 1;
                }
            }
        }
    }

    /// The box around everything.
    #[must_use]
    pub(crate) fn block(&self) -> Block {
        self.nodes.first().map_or(Block::NONE, |root| root.block)
    }
}
