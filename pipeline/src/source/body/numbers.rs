//! Rows of numbers from a glTF accessor: of any component type, strided, sparse, or without bytes. The library checks only the JSON, so
//! every index and length is checked here. Knows no mesh.

use super::container::Container;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};
use kitsuke::arrays::limits;

/// Rows of floats. Integers that are normalised count as fractions, others as themselves (KHR_mesh_quantization).
pub(in crate::source) fn floats<const N: usize>(
    file: &Container,
    accessor: &gltf::Accessor<'_>,
    dimensions: Dimensions,
) -> Result<Vec<[f32; N]>, String> {
    let most = match (accessor.data_type(), accessor.normalized()) {
        (DataType::I8, true) => 127.0,
        (DataType::U8, true) => 255.0,
        (DataType::I16, true) => 32767.0,
        (DataType::U16, true) => 65535.0,
        _ => 1.0,
    };
    let read: fn(&[u8]) -> f32 = match accessor.data_type() {
        DataType::F32 => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        DataType::I8 => |b| f32::from(b[0] as i8),
        DataType::U8 => |b| f32::from(b[0]),
        DataType::I16 => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
        DataType::U16 => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
    };
    let is_normalised = most != 1.0;
    rows(file, accessor, dimensions, |bytes| {
        let number = read(bytes) / most;
        if is_normalised { number.max(-1.0) } else { number }
    })
}

/// Rows of unsigned integers.
pub(super) fn integers<const N: usize>(
    file: &Container,
    accessor: &gltf::Accessor<'_>,
    dimensions: Dimensions,
) -> Result<Vec<[u32; N]>, String> {
    let read: fn(&[u8]) -> u32 = match accessor.data_type() {
        DataType::U8 => |b| u32::from(b[0]),
        DataType::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        other => return Err(format!("accessor {} holds {other:?}, where whole numbers must stand", accessor.index())),
    };
    rows(file, accessor, dimensions, read)
}

fn rows<const N: usize, T: Copy + Default>(
    file: &Container,
    accessor: &gltf::Accessor<'_>,
    dimensions: Dimensions,
    read: impl Fn(&[u8]) -> T,
) -> Result<Vec<[T; N]>, String> {
    let (index, count) = (accessor.index(), accessor.count());
    if accessor.dimensions() != dimensions {
        return Err(format!("accessor {index} has another shape than its use wants"));
    }
    let beyond = || format!("accessor {index} reaches beyond its buffer");
    if count > 3 * limits::TRIANGLES {
        return Err(beyond());
    }
    let size = accessor.data_type().size();
    let row = |row: &[u8]| std::array::from_fn(|i| read(&row[i * size..]));
    let mut rows = match accessor.view().filter(|_| !file.zeros.contains(&index)) {
        Some(view) => {
            let stride = view.stride().unwrap_or(N * size);
            let bytes = viewed(file, &view, accessor.offset(), count, N * size, stride).ok_or_else(beyond)?;
            bytes.chunks(stride).map(|bytes| row(&bytes[..N * size])).collect()
        }
        None => vec![[T::default(); N]; count],
    };
    let Some(sparse) = accessor.sparse() else { return Ok(rows) };
    let (indices, values) = (sparse.indices(), sparse.values());
    let width = match indices.index_type() {
        IndexType::U8 => 1,
        IndexType::U16 => 2,
        IndexType::U32 => 4,
    };
    let at = viewed(file, &indices.view(), indices.offset(), sparse.count(), width, width).ok_or_else(beyond)?;
    let given = viewed(file, &values.view(), values.offset(), sparse.count(), N * size, N * size).ok_or_else(beyond)?;
    for (at, given) in at.chunks(width).zip(given.chunks(N * size)) {
        let at = at.iter().rev().fold(0, |at, byte| at << 8 | usize::from(*byte));
        *rows.get_mut(at).ok_or_else(|| format!("accessor {index} gives row {at}, but has {count}"))? = row(given);
    }
    Ok(rows)
}

/// The bytes of `count` rows of `size` bytes each, `stride` bytes apart, in a view from an offset on.
fn viewed<'a>(
    file: &'a Container,
    view: &gltf::buffer::View<'_>,
    offset: usize,
    count: usize,
    size: usize,
    stride: usize,
) -> Option<&'a [u8]> {
    let Some(last) = count.checked_sub(1) else { return Some(&[]) };
    let span = last.checked_mul(stride)?.checked_add(size).filter(|_| stride >= size)?;
    let end = view.offset().checked_add(view.length())?;
    let bytes = file.buffers.get(view.buffer().index())?.get(view.offset()..end)?;
    bytes.get(offset..offset.checked_add(span)?)
}
