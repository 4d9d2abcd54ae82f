//! Packs: what is in them, and what a renderer needs once.

use crate::axes::Axes;
use crate::buffer::{self, Attribute, given, put, put_handle, put_struct, room, slice, write_text};
use crate::pose::{PoseData, out_of_range};
use crate::status::{Failure, Status, guarded};
use bytemuck::{Pod, Zeroable};
use kitsuke::accessories::Accessories;
use kitsuke::pack::layout;
use kitsuke::skeleton::Bone;
use kitsuke::{Garment, Pack};
use std::sync::Arc;

/// A kimono: from a pack, or fitted to a wearer.
pub struct KitsukePack(pub(crate) Arc<Kimono>);

pub(crate) enum Kimono {
    Pack(Box<Pack>),
    #[cfg_attr(not(feature = "fit"), expect(dead_code, reason = "fits alone make them"))]
    Fitted {
        garment: Box<Garment>,
        accessories: Box<Accessories>,
    },
}

impl Kimono {
    pub(crate) fn garment(&self) -> &Garment {
        match self {
            Kimono::Pack(pack) => pack.garment(),
            Kimono::Fitted { garment, .. } => garment,
        }
    }

    pub(crate) fn accessories(&self) -> &Accessories {
        match self {
            Kimono::Pack(pack) => pack.accessories(),
            Kimono::Fitted { accessories, .. } => accessories,
        }
    }
}

impl KitsukePack {
    pub(crate) fn garment(&self) -> &Garment {
        self.0.garment()
    }
}

/// Counts of a kimono.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct PackInfo {
    /// To be set by the caller: `sizeof` of this struct.
    pub struct_size: u32,
    /// Vertices of a frame, seam twins included.
    pub vertex_count: u32,
    /// Of them those that are no seam twins; they come first.
    pub unique_count: u32,
    /// Triangles.
    pub triangle_count: u32,
    /// Named pieces of cloth, in triangle order.
    pub part_count: u32,
    /// Target shapes.
    pub target_count: u32,
    /// How many of the last targets belong to no pose.
    pub corrective_count: u32,
    /// 1 if every vertex has texture coordinates.
    pub has_uv: u32,
    /// 1 if it can be fitted to wearers.
    pub has_sizes: u32,
    /// Vertices of the obi, 0 without one.
    pub obi_vertex_count: u32,
    /// Triangles of the obi.
    pub obi_triangle_count: u32,
    /// Measured paths.
    pub path_count: u32,
    /// Width of the texture, pixels; 0 without one.
    pub texture_width: u32,
    /// Height of the texture, pixels.
    pub texture_height: u32,
    /// Bytes of the texture's PNG; 0 where the pack only names it.
    pub texture_bytes: u32,
    /// Joints of the skeleton.
    pub joint_count: u32,
}

/// Texts of a kimono.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Text {
    /// The catalog's name.
    Id = 0,
    /// The name people read.
    Name = 1,
    /// The body on which it was made.
    Body = 2,
    /// The texture's file name.
    Texture = 3,
    /// The name of a part.
    Part = 4,
    /// The name of a target.
    Target = 5,
    /// The name of a measured path.
    Path = 6,
    /// Its kanji.
    PathJa = 7,
}

impl Text {
    const ALL: [Text; 8] =
        [Text::Id, Text::Name, Text::Body, Text::Texture, Text::Part, Text::Target, Text::Path, Text::PathJa];

    /// As a caller names it: a number from C may be any.
    fn of(code: i32) -> Result<Text, Failure> {
        let known = Text::ALL.into_iter().find(|text| *text as i32 == code);
        known.ok_or_else(|| (Status::Range, format!("there is no text {code}")))
    }
}

/// Opens a pack. The bytes are not needed afterwards; they may be a stranger's.
///
/// # Safety
/// `bytes` must point to `length` bytes, `pack` to a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_open(bytes: *const u8, length: usize, pack: *mut *mut KitsukePack) -> Status {
    guarded(|| {
        let open = || {
            // SAFETY: as the caller promises.
            let bytes = unsafe { slice("the pack", bytes, length) }?;
            let pack = Pack::open(bytes).map_err(|error| (Status::Pack, error.to_string()))?;
            Ok(KitsukePack(Arc::new(Kimono::Pack(Box::new(pack)))))
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the pack", pack, open) }
    })
}

/// Frees a pack; evaluators, motions, receivers and fitters made from it stay as they are.
///
/// # Safety
/// `pack` must be null or a handle that has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_free(pack: *mut KitsukePack) {
    // SAFETY: as the caller promises.
    unsafe { buffer::free(pack) };
}

/// Fills in the counts, as far as `struct_size` reaches.
///
/// # Safety
/// `pack` must be null or a handle, `info` null or a struct of as many bytes as its first field says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_info(pack: *const KitsukePack, info: *mut PackInfo) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let kimono = unsafe { &given("the pack", pack)?.0 };
        let (garment, accessories) = (kimono.garment(), kimono.accessories());
        let data = garment.data();
        let (obi, texture) = (accessories.obi.as_ref(), accessories.texture.as_ref());
        let has_sizes = match &**kimono {
            Kimono::Pack(pack) => pack.sections().iter().any(|section| section.tag == layout::FITS),
            Kimono::Fitted { .. } => false,
        };
        let [texture_width, texture_height] = texture.map_or([0; 2], |texture| texture.size_px);
        let found = PackInfo {
            struct_size: 0,
            vertex_count: garment.vertex_count() as u32,
            unique_count: garment.unique_count() as u32,
            triangle_count: garment.triangle_count() as u32,
            part_count: data.mesh.parts.len() as u32,
            target_count: data.targets.len() as u32,
            corrective_count: data.corrective_count as u32,
            has_uv: u32::from(!data.mesh.uv.is_empty()),
            has_sizes: u32::from(has_sizes),
            obi_vertex_count: obi.map_or(0, |obi| obi.positions_m.len() as u32),
            obi_triangle_count: obi.map_or(0, |obi| obi.triangles.len() as u32),
            path_count: accessories.paths.len() as u32,
            texture_width,
            texture_height,
            texture_bytes: texture.map_or(0, |texture| texture.png.len() as u32),
            joint_count: data.skeleton.joints().len() as u32,
        };
        // SAFETY: as the caller promises.
        unsafe { put_struct("info", info, &found) }
    })
}

/// Copies a text as [`kitsuke_message`](crate::kitsuke_message) does; `length`, if not null, gets its whole length. `index` counts parts,
/// targets or paths from 0 and is passed over elsewhere.
///
/// # Safety
/// `pack` must be null or a handle, `buffer` null or have room for `capacity` bytes, `length` null or a place for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_text(
    pack: *const KitsukePack,
    text: i32,
    index: u32,
    buffer: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> Status {
    guarded(|| {
        let text = Text::of(text)?;
        // SAFETY: as the caller promises.
        let kimono = unsafe { &given("the pack", pack)?.0 };
        let (data, accessories, index) = (kimono.garment().data(), kimono.accessories(), index as usize);
        let path = |what: fn(&kitsuke::accessories::Path) -> &String| {
            let paths = &accessories.paths;
            paths.get(index).map(what).ok_or_else(|| out_of_range("path", index, paths.len()))
        };
        let text: &str = match text {
            Text::Id => &data.id,
            Text::Name => &data.name,
            Text::Body => &accessories.body,
            Text::Texture => accessories.texture.as_ref().map_or("", |texture| &texture.name),
            Text::Part => {
                let part = data.mesh.parts.get(index);
                &part.ok_or_else(|| out_of_range("part", index, data.mesh.parts.len()))?.name
            }
            Text::Target => {
                &data.targets.get(index).ok_or_else(|| out_of_range("target", index, data.targets.len()))?.name
            }
            Text::Path => path(|path| &path.name)?,
            Text::PathJa => path(|path| &path.ja)?,
        };
        // SAFETY: as the caller promises.
        unsafe {
            let whole = write_text(text, buffer, capacity);
            crate::pose::put_if(length, whole);
        }
        Ok(())
    })
}

/// How many indices [`kitsuke_pack_indices`] writes: three per triangle.
///
/// # Safety
/// `pack` must be null or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_index_count(pack: *const KitsukePack) -> usize {
    // SAFETY: as the caller promises.
    unsafe { pack.as_ref() }.map_or(0, |pack| 3 * pack.garment().triangle_count())
}

/// Writes the corners of the triangles, wound as these axes want.
///
/// # Safety
/// `pack` must be null or a handle, `indices` null or have room for `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_indices(
    pack: *const KitsukePack,
    axes: i32,
    indices: *mut u32,
    count: usize,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let pack = unsafe { given("the pack", pack)? };
        // SAFETY: as the caller promises.
        unsafe { write_triangles(&pack.garment().data().mesh.triangles, axes, indices, count) }
    })
}

/// The same for the obi.
///
/// # Safety
/// As [`kitsuke_pack_indices`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_obi_indices(
    pack: *const KitsukePack,
    axes: i32,
    indices: *mut u32,
    count: usize,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let pack = unsafe { given("the pack", pack)? };
        let triangles = pack.0.accessories().obi.as_ref().map_or(&[][..], |obi| &obi.triangles);
        // SAFETY: as the caller promises.
        unsafe { write_triangles(triangles, axes, indices, count) }
    })
}

/// # Safety
/// `indices` must be null or have room for `count` numbers.
unsafe fn write_triangles(triangles: &[[u32; 3]], axes: Axes, indices: *mut u32, count: usize) -> Result<(), Failure> {
    // SAFETY: as the caller promises.
    let indices = unsafe { room("indices", indices, count, 3 * triangles.len()) }?;
    for (to, &triangle) in indices.as_chunks_mut::<3>().0.iter_mut().zip(triangles) {
        *to = axes.triangle(triangle);
    }
    Ok(())
}

/// Writes the texture coordinates of all vertices: v from the top in glTF and Unreal, from the bottom in Unity. Writes nothing
/// where there are none.
///
/// # Safety
/// `pack` must be null or a handle, the attribute's buffer null or as long as it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_uv(pack: *const KitsukePack, axes: i32, uv: Attribute) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let pack = unsafe { given("the pack", pack)? };
        let from = &pack.garment().data().mesh.uv;
        // SAFETY: as the caller promises.
        if from.is_empty() { Ok(()) } else { unsafe { uv.write_uv("texture coordinates", from, |uv| axes.uv(uv)) } }
    })
}

/// Copies the texture's PNG, as long as [`PackInfo`] says.
///
/// # Safety
/// `pack` must be null or a handle, `buffer` null or have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_texture(pack: *const KitsukePack, buffer: *mut u8, capacity: usize) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let pack = unsafe { given("the pack", pack)? };
        let png = pack.0.accessories().texture.as_ref().map_or(&[][..], |texture| &texture.png);
        // SAFETY: as the caller promises.
        unsafe { room("the texture", buffer, capacity, png.len()) }?.copy_from_slice(png);
        Ok(())
    })
}

/// The length of a measured path in the T-pose, metres.
///
/// # Safety
/// `pack` must be null or a handle, `length_m` null or a place for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_path_length(pack: *const KitsukePack, index: u32, length_m: *mut f32) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let kimono = unsafe { &given("the pack", pack)?.0 };
        let paths = &kimono.accessories().paths;
        let path = paths.get(index as usize).ok_or_else(|| out_of_range("path", index as usize, paths.len()))?;
        // SAFETY: as the caller promises.
        unsafe { put("the length", length_m, path.length_m(&kimono.garment().data().mesh.positions_m)) }
    })
}

/// Where a bone's joint rests in the T-pose, and the bone that carries it (-1: none), which may be null.
///
/// # Safety
/// `pack` must be null or a handle, `place` null or have room for three numbers, `parent` null or a place for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_joint(
    pack: *const KitsukePack,
    axes: i32,
    bone: u32,
    place: *mut f32,
    parent: *mut i32,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let skeleton = unsafe { &given("the pack", pack)?.garment().data().skeleton };
        let known = Bone::ALL.get(bone as usize);
        let bone = known.ok_or_else(|| out_of_range("bone", bone as usize, Bone::COUNT))?;
        let joint = skeleton.index_of(*bone).map(|joint| skeleton.joints()[joint]);
        let joint = joint.ok_or_else(|| (Status::Range, format!("the skeleton has no {}", bone.name())))?;
        // SAFETY: as the caller promises.
        unsafe { room("the place", place, 3, 3) }?.copy_from_slice(&axes.place(joint.rest_m).to_array());
        let carrier = joint.parent.map_or(-1, |parent| skeleton.joints()[usize::from(parent)].bone as i32);
        // SAFETY: as the caller promises.
        unsafe { crate::pose::put_if(parent, carrier) };
        Ok(())
    })
}

/// The pose of a target that belongs to one (all but the last [`PackInfo::corrective_count`]).
///
/// # Safety
/// `pack` must be null or a handle, `pose` null or a place for a pose.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_pack_target_pose(
    pack: *const KitsukePack,
    axes: i32,
    target: u32,
    pose: *mut PoseData,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let data = unsafe { given("the pack", pack)?.garment().data() };
        let (target, count) = (target as usize, data.sample_count());
        if target >= count {
            return Err(out_of_range("target with a pose", target, count));
        }
        // SAFETY: as the caller promises.
        unsafe { put("the pose", pose, PoseData::new(&data.poses.pose(target + 1), axes)) }
    })
}
