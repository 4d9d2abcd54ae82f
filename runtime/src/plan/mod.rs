//! What evaluation derives once from a garment's checked arrays: the same numbers in the order in which a frame reads them.
//! Knows no pose and no frame.

mod strips;

#[cfg(test)]
pub(crate) use strips::FEWEST_QUADS;
pub(crate) use strips::{LANES, Strip, Strips};

use crate::arrays::{GarmentData, Segment, SkinWeights};
use std::collections::BTreeMap;
use std::mem::size_of_val;

/// What evaluation derives once from a garment's arrays.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// For each segment what each layer does there.
    pub(crate) segments: Vec<Vec<LayerPart>>,
    /// The masks segment by segment, driver by driver, each three times: for x, y and z.
    pub(crate) masks: Vec<u16>,
    pub(crate) skin: BlockedSkin,
    /// Over the unique vertices, so that normals are smooth across seams.
    pub(crate) normals: Strips,
}

/// What a layer does in a segment.
#[derive(Clone, Debug)]
pub(crate) struct LayerPart {
    layer: u8,
    /// Which of the segment's drivers belong to the layer.
    pub(crate) columns: Vec<u8>,
    /// The layer's targets that move the segment.
    pub(crate) pieces: Vec<Piece>,
    /// Whether the layer's masks of every vertex sum to one.
    pub(crate) is_whole: bool,
}

/// A target's deltas in one segment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    pub(crate) target: u16,
    /// Index of the first delta in the target.
    pub(crate) start: u32,
}

/// Vertices skinned at a time, one in each lane of the vector registers.
pub(crate) const SKIN_LANES: usize = 16;

/// Skin weights by blocks of [`SKIN_LANES`] vertices: neighbours are moved by the same few joints.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlockedSkin {
    /// How many joints move each block.
    pub(crate) counts: Vec<u8>,
    /// Those joints, block after block.
    pub(crate) joints: Vec<u8>,
    /// The weights of each such joint in 1/65535, 0 where it does not move the vertex.
    pub(crate) weights: Vec<[u16; SKIN_LANES]>,
}

impl BlockedSkin {
    fn new(skin: &[SkinWeights]) -> BlockedSkin {
        let mut blocked = BlockedSkin::default();
        for block in skin.chunks(SKIN_LANES) {
            let mut by_joint = BTreeMap::new();
            for (lane, vertex) in block.iter().enumerate() {
                for (&joint, &weight) in vertex.joints.iter().zip(&vertex.weights) {
                    if weight != 0 {
                        by_joint.entry(joint).or_insert([0; SKIN_LANES])[lane] += weight;
                    }
                }
            }
            blocked.counts.push(by_joint.len() as u8);
            blocked.joints.extend(by_joint.keys());
            blocked.weights.extend(by_joint.values());
        }
        blocked
    }

    pub(crate) fn bytes(&self) -> usize {
        self.counts.len() + self.joints.len() + size_of_val(self.weights.as_slice())
    }
}

impl Plan {
    /// Of checked arrays.
    pub(crate) fn new(data: &GarmentData) -> Plan {
        let mut segments: Vec<Vec<LayerPart>> = data.segments.iter().map(|segment| parts(data, segment)).collect();
        for (number, target) in data.targets.iter().enumerate() {
            let mut start = 0;
            for &segment in &target.segments {
                let segment = usize::from(segment);
                if let Some(part) = segments[segment].iter_mut().find(|part| part.layer == target.layer) {
                    part.pieces.push(Piece { target: number as u16, start });
                }
                start += data.segments[segment].vertex_count;
            }
        }
        let unique = data.mesh.positions_m.len();
        let triangles: Vec<_> =
            data.mesh.triangles.iter().map(|corners| corners.map(|v| data.mesh.unique(v))).collect();
        let normals = Strips::new(unique, &triangles);
        let mut masks = Vec::new();
        for Segment { drivers, masks: rows, .. } in &data.segments {
            for column in 0..drivers.len() {
                let of_driver = rows.iter().skip(column).step_by(drivers.len());
                masks.extend(of_driver.flat_map(|&mask| [mask; 3]));
            }
        }
        Plan { segments, masks, skin: BlockedSkin::new(&data.skin), normals }
    }
}

/// The layers of a segment's drivers, ascending, yet without targets.
fn parts(data: &GarmentData, segment: &Segment) -> Vec<LayerPart> {
    let mut by_layer: BTreeMap<u8, Vec<u8>> = BTreeMap::new();
    for (column, &driver) in segment.drivers.iter().enumerate() {
        by_layer.entry(data.drivers[usize::from(driver)].layer).or_default().push(column as u8);
    }
    let part = |(layer, columns): (u8, Vec<u8>)| {
        let sum = |row: &[u16]| columns.iter().map(|&column| u32::from(row[usize::from(column)])).sum::<u32>();
        // Without masks the one driver owns every vertex wholly.
        let is_whole = segment.masks.chunks_exact(segment.drivers.len()).all(|row| sum(row) == u32::from(u16::MAX));
        LayerPart { layer, columns, pieces: Vec::new(), is_whole }
    };
    by_layer.into_iter().map(part).collect()
}
