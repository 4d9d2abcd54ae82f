//! The nodes of a glTF file: where each stands in the world, and on what it hangs. Knows neither skins nor bones.

use glam::DMat4;

/// Most nodes of a file.
const MOST: usize = 1 << 16;

/// A file's nodes.
pub(in crate::source) struct Nodes {
    /// World from node, metres, with the transforms that the file shows.
    pub world: Vec<DMat4>,
    /// On which node each hangs.
    pub parent: Vec<Option<usize>>,
    /// Whether it hangs in a scene; all do where there is no scene.
    pub is_shown: Vec<bool>,
    /// Names, empty where there is none.
    pub name: Vec<String>,
}

impl Nodes {
    /// Of a document, in a world that is turned by `turn`.
    pub fn new(document: &gltf::Document, turn: DMat4) -> Result<Nodes, String> {
        let count = document.nodes().count();
        if count > MOST {
            return Err(format!("the file has more than {MOST} nodes"));
        }
        let name = document.nodes().map(|node| node.name().unwrap_or_default().to_owned()).collect();
        let mut parent = vec![None; count];
        for node in document.nodes() {
            for child in node.children() {
                if parent[child.index()].replace(node.index()).is_some() {
                    return Err("the nodes form no tree".to_owned());
                }
            }
        }
        let mut world = vec![turn; count];
        let mut is_placed = vec![false; count];
        let mut pending: Vec<usize> = (0..count).filter(|&node| parent[node].is_none()).collect();
        let nodes: Vec<gltf::Node<'_>> = document.nodes().collect();
        while let Some(node) = pending.pop() {
            let local =
                DMat4::from_cols_array_2d(&nodes[node].transform().matrix().map(|column| column.map(f64::from)));
            world[node] = parent[node].map_or(turn, |above| world[above]) * local;
            is_placed[node] = true;
            pending.extend(nodes[node].children().map(|child| child.index()));
        }
        // Each has one parent at most, so what no root reaches hangs on itself.
        if is_placed.contains(&false) {
            return Err("the nodes form no tree".to_owned());
        }
        let mut is_shown = vec![document.scenes().len() == 0; count];
        let mut pending: Vec<usize> =
            document.scenes().flat_map(|scene| scene.nodes()).map(|node| node.index()).collect();
        while let Some(node) = pending.pop() {
            if !std::mem::replace(&mut is_shown[node], true) {
                pending.extend(nodes[node].children().map(|child| child.index()));
            }
        }
        Ok(Nodes { world, parent, is_shown, name })
    }

    /// The node and all above it.
    pub fn upwards(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |&node| self.parent[node])
    }
}
