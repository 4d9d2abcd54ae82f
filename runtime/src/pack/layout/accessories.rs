//! The section of what comes with the kimono, but for the texture's image.

use crate::accessories::{Accessories, Obi, Path, Texture, limits};
use crate::arrays::limits as garment_limits;
use crate::pack::ContentProblem;
use crate::pack::codec::Reader;
use glam::Vec3;

#[cfg(feature = "write")]
use crate::pack::codec::Writer;

/// The section `ACCS`.
pub(in crate::pack) fn read_accessories(from: &mut Reader<'_>) -> Result<Accessories, ContentProblem> {
    let body = from.text()?;
    let texture = if from.flag()? { Some(read_texture(from)?) } else { None };
    let obi = if from.flag()? { Some(read_obi(from)?) } else { None };
    let paths = from.count("paths", limits::PATHS)?;
    let paths = (0..paths).map(|_| read_path(from)).collect::<Result<_, _>>()?;
    Ok(Accessories { body, texture, obi, paths })
}

#[cfg(feature = "write")]
pub(in crate::pack) fn write_accessories(accessories: &Accessories, to: &mut Writer) {
    let Accessories { body, texture, obi, paths } = accessories;
    to.text(body);
    to.flag(texture.is_some());
    if let Some(Texture { name, size_px, .. }) = texture {
        to.text(name);
        size_px.iter().for_each(|&side| to.u32(side));
    }
    to.flag(obi.is_some());
    if let Some(obi) = obi {
        write_obi(obi, to);
    }
    to.count(paths.len());
    for Path { name, ja, vertices, offset_m } in paths {
        [name, ja].into_iter().for_each(|text| to.text(text));
        to.f32(*offset_m);
        to.count(vertices.len());
        to.column::<4>(vertices.iter().copied());
    }
}

fn read_texture(from: &mut Reader<'_>) -> Result<Texture, ContentProblem> {
    Ok(Texture { name: from.text()?, size_px: [from.u32()?, from.u32()?], png: Vec::new() })
}

fn read_obi(from: &mut Reader<'_>) -> Result<Obi, ContentProblem> {
    let vertices = from.count("vertices of the obi", limits::OBI_VERTICES)?;
    let triangles = from.count("triangles of the obi", limits::OBI_TRIANGLES)?;
    let [x, y, z] = from.floats(vertices)?;
    let positions_m = x.zip(y).zip(z).map(|((x, y), z)| Vec3::new(x, y, z)).collect();
    let mut corners = from.column::<4>(3 * triangles)?;
    let mut corner = || corners.next().expect("three corners per triangle");
    let triangles = (0..triangles).map(|_| [corner(), corner(), corner()]).collect();
    Ok(Obi { positions_m, triangles, skin: super::read_skin(vertices, from)? })
}

#[cfg(feature = "write")]
fn write_obi(Obi { positions_m, triangles, skin }: &Obi, to: &mut Writer) {
    to.count(positions_m.len());
    to.count(triangles.len());
    to.floats(positions_m, |position| position.to_array());
    to.column::<4>(triangles.iter().flatten().copied());
    super::write_skin(skin, to);
}

fn read_path(from: &mut Reader<'_>) -> Result<Path, ContentProblem> {
    let [name, ja] = [from.text()?, from.text()?];
    let offset_m = from.f32()?;
    let vertices = from.count("vertices of a path", garment_limits::VERTICES)?;
    Ok(Path { name, ja, offset_m, vertices: from.column::<4>(vertices)?.collect() })
}
