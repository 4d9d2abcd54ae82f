//! Where mesh and joints rest in the world, by a skin's bind matrices: their inverses say where the joints were when the mesh was bound.
//! Knows no bones and does not judge the pose.
//!
//! A vertex is shown at Σ weight · (world from joint) · (joint from mesh) · place. Where mesh and joints rest as they were bound, all those
//! products are one transform, whatever the axes of the joints and the scale of the nodes above them: world from mesh.

use super::container::Container;
use super::nodes::Nodes;
use super::numbers::floats;
use glam::{DMat4, DVec3, Vec3};
use gltf::accessor::Dimensions;

/// How far two turns or scales may differ and still be one.
const SAME: f64 = 2e-3;
/// How far two transforms may move a joint apart and still be one, metres.
const SAME_M: f64 = 2e-3;
/// A transform that differs less from none is none, and a place that differs less from another one is the same.
pub(super) const NONE: f64 = 1e-5;

/// A skin's joints and how the mesh was bound to them.
pub(in crate::source) struct Skin {
    /// Nodes.
    pub joints: Vec<usize>,
    /// Joint from mesh, one per joint: the inverse bind matrices.
    pub joint_from_mesh: Vec<DMat4>,
    /// Whether the file has matrices; where it has none they are no transform, by the format.
    pub is_bound: bool,
}

/// How a skin's mesh comes into the world.
pub(in crate::source) enum Rest {
    /// World from mesh, the same for all joints.
    Bound(DMat4),
    /// World from mesh by each joint: the pose that the file shows is not the one in which the mesh was bound.
    Shown(Vec<DMat4>),
}

/// The skins of a file.
pub(in crate::source) fn skins(file: &Container, most_joints: usize) -> Result<Vec<Skin>, String> {
    let skin = |skin: gltf::Skin<'_>| {
        let joints: Vec<usize> = skin.joints().map(|node| node.index()).take(most_joints + 1).collect();
        if joints.len() > most_joints {
            return Err(format!("the skin has more than {most_joints} joints"));
        }
        let Some(accessor) = skin.inverse_bind_matrices() else {
            let joint_from_mesh = vec![DMat4::IDENTITY; joints.len()];
            return Ok(Skin { joints, joint_from_mesh, is_bound: false });
        };
        let matrices = floats::<16>(file, &accessor, Dimensions::Mat4)?;
        let joint_from_mesh: Vec<DMat4> =
            matrices.iter().map(|matrix| DMat4::from_cols_array(&matrix.map(f64::from))).collect();
        if joint_from_mesh.len() < joints.len() {
            return Err(format!("a skin of {} joints has {} bind matrices", joints.len(), joint_from_mesh.len()));
        }
        let is_usable = |matrix: &DMat4| matrix.is_finite() && matrix.determinant().abs() > 1e-30;
        match joint_from_mesh.iter().zip(&joints).find(|(matrix, _)| !is_usable(matrix)) {
            Some((_, joint)) => Err(format!("the bind matrix of joint {joint} of a skin cannot be inverted")),
            None => Ok(Skin { joints, joint_from_mesh, is_bound: true }),
        }
    };
    file.document.skins().map(skin).collect()
}

impl Skin {
    /// The skin as the file shows it.
    pub fn shown(&self, nodes: &Nodes) -> Rest {
        let by_joint: Vec<DMat4> = (0..self.joints.len()).map(|joint| self.by_joint(nodes, joint)).collect();
        let Some(first) = by_joint.first().copied() else { return Rest::Shown(by_joint) };
        let mesh_from_world = first.inverse();
        let is_first = |(joint, by_joint): (&usize, &DMat4)| {
            let apart = *by_joint * mesh_from_world;
            let place_m = nodes.world[*joint].w_axis.truncate();
            let turned = [apart.x_axis - DMat4::IDENTITY.x_axis, apart.y_axis - DMat4::IDENTITY.y_axis];
            let turned = turned.into_iter().chain([apart.z_axis - DMat4::IDENTITY.z_axis]);
            turned.map(|column| column.abs().max_element()).fold(0.0, f64::max) <= SAME
                && apart.transform_point3(place_m).distance(place_m) <= SAME_M
        };
        match self.joints.iter().zip(&by_joint).all(is_first) {
            true if first.abs_diff_eq(DMat4::IDENTITY, NONE) => Rest::Bound(DMat4::IDENTITY),
            true => Rest::Bound(first),
            false => Rest::Shown(by_joint),
        }
    }

    /// The skin as it was bound, in the space of what the topmost joint hangs on: there exporters bind, wherever an animation takes the
    /// joints.
    pub fn bound(&self, nodes: &Nodes) -> Rest {
        let is_topmost = |joint: &&usize| !nodes.upwards(**joint).skip(1).any(|above| self.joints.contains(&above));
        let above = self.joints.iter().find(is_topmost).and_then(|&topmost| nodes.parent[topmost]);
        Rest::Bound(above.map_or(DMat4::IDENTITY, |above| nodes.world[above]))
    }

    /// The frame at rest, world from node, of a node that is a joint of this skin, or hangs on one.
    pub fn frame(&self, nodes: &Nodes, rest: &Rest, node: usize) -> Option<DMat4> {
        let (above, joint) = nodes.upwards(node).find_map(|above| {
            let joint = self.joints.iter().position(|joint| *joint == above)?;
            Some((above, joint))
        })?;
        let world_from_joint = match rest {
            Rest::Shown(_) => return Some(nodes.world[node]),
            Rest::Bound(world_from_mesh) => *world_from_mesh * self.joint_from_mesh[joint].inverse(),
        };
        let joint_from_node = nodes.world[above].inverse() * nodes.world[node];
        Some(if above == node { world_from_joint } else { world_from_joint * joint_from_node })
    }

    fn by_joint(&self, nodes: &Nodes, joint: usize) -> DMat4 {
        nodes.world[self.joints[joint]] * self.joint_from_mesh[joint]
    }
}

impl Rest {
    /// Where a vertex rests, metres; `influences` are joints of the skin and weights that sum to 1.
    pub fn vertex_m(&self, place: Vec3, influences: &[(u32, f32)]) -> Vec3 {
        match self {
            Rest::Bound(world_from_mesh) => world_from_mesh.transform_point3(place.as_dvec3()).as_vec3(),
            Rest::Shown(by_joint) => {
                let by = |&(joint, weight): &(u32, f32)| {
                    by_joint.get(joint as usize).map_or(DVec3::ZERO, |world_from_mesh| {
                        f64::from(weight) * world_from_mesh.transform_point3(place.as_dvec3())
                    })
                };
                influences.iter().map(by).sum::<DVec3>().as_vec3()
            }
        }
    }
}
