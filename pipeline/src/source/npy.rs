//! Arrays as numpy writes them (NPY), of one expected type and row length. Knows no meaning of the numbers.

use bytemuck::Pod;

/// The numbers of an NPY file of this element type (as numpy names it, for example `<f8`) and shape: `(n,)` where `row` is 1, else
/// `(n, row)`.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn read<T: Pod>(bytes: &[u8], descr: &str, row: usize) -> Result<Vec<T>, String> {
    let (text, numbers) = header(bytes).ok_or("is no NPY file")?;
    let wanted = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (");
    let shape = text.strip_prefix(wanted.as_str()).ok_or_else(|| format!("is no array of {descr}: {}", text.trim()))?;
    let shape = shape.trim_end().strip_suffix("), }").ok_or("has no shape")?;
    let sizes: Option<Vec<usize>> =
        shape.split(',').map(str::trim).filter(|n| !n.is_empty()).map(|n| n.parse().ok()).collect();
    let rows = match (sizes.as_deref(), row) {
        (Some(&[rows]), 1) => rows,
        (Some(&[rows, columns]), _) if columns == row && row > 1 => rows,
        _ => return Err(format!("has the shape ({shape}) instead of rows of {row}")),
    };
    let length = rows.checked_mul(row).and_then(|n| n.checked_mul(size_of::<T>()));
    if length != Some(numbers.len()) {
        return Err(format!("says that its shape is ({shape}) and holds {} bytes", numbers.len()));
    }
    Ok(bytemuck::pod_collect_to_vec(numbers))
}

/// The header's text and what follows it.
fn header(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(b"\x93NUMPY")?;
    let (version, rest) = rest.split_first_chunk::<2>()?;
    let (length, rest) = match version[0] {
        1 => rest.split_first_chunk::<2>().map(|(n, rest)| (usize::from(u16::from_le_bytes(*n)), rest))?,
        2 | 3 => rest.split_first_chunk::<4>().map(|(n, rest)| (u32::from_le_bytes(*n) as usize, rest))?,
        _ => return None,
    };
    let (text, numbers) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(text).ok()?, numbers))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(descr: &str, shape: &[usize], numbers: &[f64]) -> Vec<u8> {
        [crate::look::frames::npy_header_of(descr, shape), bytemuck::cast_slice(numbers).to_vec()].concat()
    }

    #[test]
    fn arrays_come_back() {
        assert_eq!(read::<f64>(&file("<f8", &[2, 3], &[1.0; 6]), "<f8", 3), Ok(vec![1.0; 6]));
        assert_eq!(read::<f64>(&file("<f8", &[2], &[1.0, 2.0]), "<f8", 1), Ok(vec![1.0, 2.0]));
        assert_eq!(read::<f64>(&file("<f8", &[0, 3], &[]), "<f8", 3), Ok(vec![]));
    }

    #[test]
    fn other_types_shapes_and_lengths_are_refused() {
        let whole = file("<f8", &[2, 3], &[1.0; 6]);
        assert!(read::<i32>(&whole, "<i4", 3).is_err());
        assert!(read::<f64>(&whole, "<f8", 2).is_err());
        assert!(read::<f64>(&whole, "<f8", 1).is_err());
        for length in 0..whole.len() {
            assert!(read::<f64>(&whole[..length], "<f8", 3).is_err(), "cut at {length}");
        }
        assert!(read::<f64>(&file("<f8", &[usize::MAX, 3], &[1.0; 6]), "<f8", 3).is_err());
    }
}
