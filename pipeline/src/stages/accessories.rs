//! What comes with a garment, in the pack's vertex order. Knows the arrays of a pack, not their bytes.

use crate::ir;
use crate::stages::fit_data::packed_from_source;
use kitsuke::accessories::{Accessories, Obi, Path, Texture};
use kitsuke::garment::Garment;

/// Obi, texture and measured paths of the garment that was made of `source`.
#[must_use]
pub fn accessories(source: &ir::Garment, garment: &Garment) -> Accessories {
    let packed = packed_from_source(&garment.data().mesh);
    let path = |path: &ir::MeasuredPath| Path {
        name: path.name.clone(),
        ja: path.ja.clone(),
        vertices: path.vertices.iter().map(|&v| packed[v as usize]).collect(),
        offset_m: path.offset_m,
    };
    let texture = |texture: &Texture| match source.texture_in_pack {
        true => texture.clone(),
        false => Texture { png: Vec::new(), ..texture.clone() },
    };
    Accessories {
        body: source.body_name.clone(),
        texture: source.texture.as_ref().map(texture),
        obi: source.obi.as_ref().map(|obi| Obi::over(garment, obi.positions_m.clone(), obi.triangles.clone())),
        paths: source.paths.iter().map(path).collect(),
    }
}
