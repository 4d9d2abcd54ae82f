//! Which nodes of a file are which bones, and with which bone every other joint goes. Knows names and who hangs on whom, no places.

use super::super::manifest::unknown_bone;
use super::nodes::Nodes;
use kitsuke::skeleton::Bone;
use kitsuke::skeleton::names::bones_of;
use std::collections::BTreeMap;

/// Bones without which nobody can tell how a body stands.
const NEEDED: [Bone; 13] = [
    Bone::Hips,
    Bone::LeftUpperArm,
    Bone::LeftLowerArm,
    Bone::LeftHand,
    Bone::RightUpperArm,
    Bone::RightLowerArm,
    Bone::RightHand,
    Bone::LeftUpperLeg,
    Bone::LeftLowerLeg,
    Bone::LeftFoot,
    Bone::RightUpperLeg,
    Bone::RightLowerLeg,
    Bone::RightFoot,
];
/// How many names a message lists.
const LISTED: usize = 8;

/// The bones of a file, in their own order, which puts parents first.
pub(super) struct Joints {
    /// Bone, its node, and the place in this list of the bone on which it hangs; hips come first and hang on none.
    pub bones: Vec<(Bone, usize, Option<u8>)>,
    /// Joints that are no bones, each with the place in the list of the bone with which it goes.
    pub others: BTreeMap<usize, u8>,
}

impl Joints {
    /// `humanoid` is what the file itself says, `joint_nodes` are the joints of all skins, each once.
    pub fn new(nodes: &Nodes, humanoid: &[(Bone, usize)], joint_nodes: &[usize]) -> Result<Joints, String> {
        let said = if humanoid.is_empty() { by_name(nodes, joint_nodes)? } else { humanoid.to_vec() };
        let mut node_of = BTreeMap::new();
        for (bone, node) in said {
            if node >= nodes.name.len() {
                return Err(format!("the file says that {} is node {node}, which does not exist", bone.name()));
            }
            if node_of.insert(bone, node).is_some() {
                return Err(format!("the file names two nodes as {}", bone.name()));
            }
        }
        let missing: Vec<&str> =
            NEEDED.iter().filter(|bone| !node_of.contains_key(bone)).map(|bone| bone.name()).collect();
        if !missing.is_empty() {
            return Err(without(&missing, nodes, &node_of, joint_nodes));
        }
        let slot_of: BTreeMap<usize, u8> = node_of.values().copied().zip(0..).collect();
        let above = |node: usize| nodes.upwards(node).skip(1).find_map(|node| slot_of.get(&node).copied());
        let mut bones = Vec::new();
        for (&bone, &node) in &node_of {
            // Some rigs hang legs beside the hips.
            let parent = above(node).or((bone != Bone::Hips).then_some(0));
            if parent.is_some_and(|parent| usize::from(parent) >= bones.len()) {
                return Err(format!("joint {} hangs on a joint that should hang on it", nodes.name[node]));
            }
            bones.push((bone, node, parent));
        }
        let is_other = |node: &&usize| !slot_of.contains_key(node);
        let others = joint_nodes.iter().filter(is_other).map(|&node| (node, above(node).unwrap_or(0))).collect();
        Ok(Joints { bones, others })
    }

    /// The place in the list of the bone with which a joint of a skin goes.
    pub fn slot(&self, node: usize) -> Option<u8> {
        let is_own = self.bones.iter().position(|(_, own, _)| *own == node).map(|slot| slot as u8);
        is_own.or_else(|| self.others.get(&node).copied())
    }

    /// What a warning says of joints that are no bones, or misspelt ones, and move skin.
    pub fn said_of_others(&self, nodes: &Nodes, moves_skin: impl Fn(usize) -> bool) -> Option<String> {
        let said = |(&node, &slot): (&usize, &u8)| {
            format!("{} with {}", named(&nodes.name[node]), self.bones[usize::from(slot)].0.name())
        };
        let said: Vec<String> = self.others.iter().filter(|(node, _)| moves_skin(**node)).map(said).collect();
        (!said.is_empty()).then(|| listed(said.into_iter()))
    }
}

fn by_name(nodes: &Nodes, joint_nodes: &[usize]) -> Result<Vec<(Bone, usize)>, String> {
    let names: Vec<&str> = joint_nodes.iter().map(|&node| nodes.name[node].as_str()).collect();
    let found: Vec<(Bone, usize)> =
        bones_of(&names).into_iter().zip(joint_nodes).filter_map(|(bone, &node)| Some((bone?, node))).collect();
    for &(bone, node) in &found {
        let name = &nodes.name[node];
        if joint_nodes.iter().any(|&other| other != node && nodes.name[other] == *name) {
            let bone = bone.name();
            return Err(format!("two joints are called {name} ({bone}): keep one body in the file, with one skeleton"));
        }
    }
    Ok(found)
}

/// Says which bones are missing, and which joints might be meant.
fn without(missing: &[&str], nodes: &Nodes, node_of: &BTreeMap<Bone, usize>, joint_nodes: &[usize]) -> String {
    let unknown: Vec<&str> = joint_nodes
        .iter()
        .filter(|node| !node_of.values().any(|known| known == *node))
        .map(|&node| nodes.name[node].as_str())
        .collect();
    let meant = unknown.iter().map(|name| unknown_bone(name)).find(|said| said.contains("did you mean"));
    let missing = listed(missing.iter().map(|name| (*name).to_owned()));
    let unknown = match (meant, unknown.is_empty()) {
        (Some(meant), _) => format!(": {meant}"),
        (None, true) => String::new(),
        (None, false) => {
            format!("; joints with names that say nothing: {}", listed(unknown.iter().map(|name| named(name))))
        }
    };
    format!("no joint is {missing}{unknown}")
}

fn named(name: &str) -> String {
    match name.char_indices().nth(40) {
        _ if name.is_empty() => "a joint without a name".to_owned(),
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

fn listed(names: impl ExactSizeIterator<Item = String>) -> String {
    let more = names.len().saturating_sub(LISTED);
    let names = names.take(LISTED).collect::<Vec<_>>().join(", ");
    if more == 0 { names } else { format!("{names} and {more} more") }
}
