//! The one validation of [`Accessories`], for those who write packs and those who read them.

use super::{Accessories, Obi, Path, Texture};
use crate::arrays::{InvalidGarment, SkinWeights, check_count, check_length, is_name, limits as garment_limits};
use crate::garment::Garment;
use glam::Vec3;

/// Sizes beyond which nothing is kept.
pub mod limits {
    /// Most vertices of an obi.
    pub const OBI_VERTICES: usize = 1 << 18;
    /// Most triangles of an obi.
    pub const OBI_TRIANGLES: usize = 1 << 19;
    /// Most measured paths.
    pub const PATHS: usize = 256;
    /// Longest side of a texture, pixels.
    pub const TEXTURE_PX: u32 = 16384;
    /// Longest texture, bytes.
    pub const TEXTURE_BYTES: usize = 64 << 20;
}

/// Which accessory is wrong, and what is wrong with it. Elements are numbered from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidAccessories {
    /// There are too many elements, or an array differs in length from what it describes.
    #[error(transparent)]
    Arrays(#[from] InvalidGarment),
    /// The body's name is too long or not printable.
    #[error("the body's name must be at most {max} bytes of printable text", max = garment_limits::NAME_BYTES)]
    Body,
    /// The texture's name is empty, too long or not printable.
    #[error("the texture's name must be 1 to {max} bytes of printable text", max = garment_limits::NAME_BYTES)]
    TextureName,
    /// The texture has no pixels or too many.
    #[error("a texture of {width} x {height} pixels is not possible; 1 to {max} on each side are", max = limits::TEXTURE_PX)]
    TextureSize {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// The texture's image is no PNG of the stated size.
    #[error("the texture's image is no PNG of {width} x {height} pixels")]
    TextureImage {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// A position of the obi is not finite or out of bounds.
    #[error("the position of the obi's vertex {0} is not within {max} m of the origin", max = garment_limits::EXTENT_M)]
    ObiPosition(usize),
    /// A triangle of the obi has a corner that does not exist.
    #[error("triangle {0} of the obi has a corner that does not exist")]
    ObiTriangle(usize),
    /// A vertex of the obi follows a frame that the skeleton lacks, or its weights do not sum to 65535.
    #[error("the obi's vertex {0} follows a joint that the skeleton lacks, or its weights do not sum to 65535")]
    ObiSkin(usize),
    /// A path's name or kanji is too long, not printable, or the name is empty or there twice.
    #[error("path {0} must have a name of its own, 1 to {max} bytes of printable text", max = garment_limits::NAME_BYTES)]
    PathName(usize),
    /// A path has fewer than two vertices, or one that does not exist, or an offset out of range.
    #[error("path {0} must join two or more unique vertices of the mesh, with an offset within {max} m", max = garment_limits::EXTENT_M)]
    Path(usize),
}

impl Accessories {
    /// Checks everything that [`Obi::pose`] and [`Path::length_m`] rely on. Of an image in the pack only the size is looked at: whoever
    /// decodes it decodes a stranger's file.
    ///
    /// # Errors
    /// Names the first element that breaks a rule.
    pub fn check(&self, garment: &Garment) -> Result<(), InvalidAccessories> {
        if !(self.body.is_empty() || is_name(&self.body)) {
            return Err(InvalidAccessories::Body);
        }
        self.texture.as_ref().map_or(Ok(()), check_texture)?;
        self.obi.as_ref().map_or(Ok(()), |obi| check_obi(obi, garment))?;
        check_count("paths", self.paths.len(), 0, limits::PATHS)?;
        let mut names: Vec<&str> = self.paths.iter().map(|path| path.name.as_str()).collect();
        names.sort_unstable();
        self.paths.iter().enumerate().try_for_each(|(i, path)| check_path(i, path, &names, garment))
    }
}

fn check_texture(Texture { name, size_px: [width, height], png }: &Texture) -> Result<(), InvalidAccessories> {
    let (width, height) = (*width, *height);
    if !is_name(name) {
        return Err(InvalidAccessories::TextureName);
    }
    if ![width, height].iter().all(|side| (1..=limits::TEXTURE_PX).contains(side)) {
        return Err(InvalidAccessories::TextureSize { width, height });
    }
    check_count("bytes of the texture", png.len(), 0, limits::TEXTURE_BYTES)?;
    if png.is_empty() || png_size_px(png) == Some([width, height]) {
        Ok(())
    } else {
        Err(InvalidAccessories::TextureImage { width, height })
    }
}

/// Width and height by a PNG's header, which is its first chunk.
pub(super) fn png_size_px(png: &[u8]) -> Option<[u32; 2]> {
    let header = png.strip_prefix(b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR")?;
    let (sides, _) = header.first_chunk::<8>()?.as_chunks::<4>();
    Some([u32::from_be_bytes(sides[0]), u32::from_be_bytes(sides[1])])
}

fn check_obi(obi: &Obi, garment: &Garment) -> Result<(), InvalidAccessories> {
    let Obi { positions_m, triangles, skin } = obi;
    check_count("vertices of the obi", positions_m.len(), 1, limits::OBI_VERTICES)?;
    check_count("triangles of the obi", triangles.len(), 1, limits::OBI_TRIANGLES)?;
    check_length("skin weights of the obi", skin.len(), positions_m.len())?;
    let is_near = |p: &Vec3| p.abs().max_element() <= garment_limits::EXTENT_M && !p.is_nan();
    if let Some(vertex) = positions_m.iter().position(|p| !is_near(p)) {
        return Err(InvalidAccessories::ObiPosition(vertex));
    }
    if let Some(triangle) = triangles.iter().position(|t| t.iter().any(|&v| v as usize >= positions_m.len())) {
        return Err(InvalidAccessories::ObiTriangle(triangle));
    }
    let frames = garment.data().skeleton.frame_count();
    let is_sound = |skin: &SkinWeights| {
        skin.joints.iter().all(|&joint| usize::from(joint) < frames)
            && skin.weights.iter().map(|&weight| u32::from(weight)).sum::<u32>() == u32::from(u16::MAX)
    };
    skin.iter().position(|skin| !is_sound(skin)).map_or(Ok(()), |vertex| Err(InvalidAccessories::ObiSkin(vertex)))
}

fn check_path(index: usize, path: &Path, names: &[&str], garment: &Garment) -> Result<(), InvalidAccessories> {
    let Path { name, ja, vertices, offset_m } = path;
    let own = names.partition_point(|other| *other <= name.as_str())
        - names.partition_point(|other| *other < name.as_str())
        == 1;
    if !(own && is_name(name) && (ja.is_empty() || is_name(ja))) {
        return Err(InvalidAccessories::PathName(index));
    }
    let unique = garment.unique_count();
    let joined = vertices.len() >= 2 && vertices.iter().all(|&vertex| (vertex as usize) < unique);
    // Not the other way round: NaN is out of range.
    let near = offset_m.abs() <= garment_limits::EXTENT_M;
    if joined && near { Ok(()) } else { Err(InvalidAccessories::Path(index)) }
}
