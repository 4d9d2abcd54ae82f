//! The section `SFLD`: the displacement fields of the sizes, and `FLDS`, what stood there before 5.3.
//!
//! Every vertex belongs to the first part of which it is a corner. That part's field is not stored there: it is what the others leave of
//! the sum over the parts. So the noise of a size is written once, and elsewhere fields are smooth.

use crate::arrays::Mesh;
use crate::fit::{Field, limits};
use crate::garment::Garment;
use crate::pack::ContentProblem;
use crate::pack::codec::Reader;
use crate::pack::field::{self, Lower};
use crate::pack::residuals::{Predictor, ResidualReader};

#[cfg(feature = "write")]
use {crate::fit::FitData, crate::pack::codec::Writer, glam::Vec3};

/// Which fields of the codec stand for which fields of the sizes: first the sums, size after size, then part after part likewise.
struct Stored {
    /// The part to which each vertex belongs.
    owner: Vec<u16>,
    parts: usize,
    sizes: usize,
    /// How many vertices belong to the same part, and the fields stored there.
    runs: Vec<(usize, Vec<u16>)>,
}

impl Stored {
    fn new(mesh: &Mesh, sizes: usize) -> Stored {
        let (owner, parts) = (owners(mesh), mesh.parts.len());
        let fields = |owner: u16| {
            let kinds = (0..=parts).filter(|kind| *kind != usize::from(owner) + 1);
            kinds.flat_map(|kind| (0..sizes).map(move |size| (kind * sizes + size) as u16)).collect()
        };
        let runs = owner.chunk_by(|one, other| one == other).map(|run| (run.len(), fields(run[0]))).collect();
        Stored { owner, parts, sizes, runs }
    }

    fn count(&self) -> usize {
        (self.parts + 1) * self.sizes
    }

    /// The codec's fields: `of` gives what a size has at a vertex, summed or of a part.
    #[cfg(feature = "write")]
    fn gathered<T>(&self, of: impl Fn(Option<usize>, usize, usize) -> T) -> Vec<Vec<T>> {
        let vertices = |part: Option<usize>| {
            (0..self.owner.len()).filter(move |&v| part.is_none_or(|part| part != usize::from(self.owner[v])))
        };
        let of = &of;
        let kinds = (0..=self.parts).map(|kind| kind.checked_sub(1));
        let fields = kinds.flat_map(|part| (0..self.sizes).map(move |size| (part, size)));
        fields.map(|(part, size)| vertices(part).map(|v| of(part, size, v)).collect()).collect()
    }

    /// Part after part and size after size the deltas that the codec's fields stand for.
    fn spread(&self, stored: &[Vec<[i16; 3]>]) -> Vec<Vec<[i16; 3]>> {
        let mut deltas = vec![Vec::with_capacity(self.owner.len()); self.parts * self.sizes];
        for size in 0..self.sizes {
            let mut rest: Vec<_> =
                (0..=self.parts).map(|kind| stored[kind * self.sizes + size].iter().copied()).collect();
            for &owner in &self.owner {
                let mut left = rest[0].next().unwrap_or_default();
                for part in (0..self.parts).filter(|part| *part != usize::from(owner)) {
                    let delta = rest[part + 1].next().unwrap_or_default();
                    (0..3).for_each(|i| left[i] = left[i].wrapping_sub(delta[i]));
                    deltas[part * self.sizes + size].push(delta);
                }
                deltas[usize::from(owner) * self.sizes + size].push(left);
            }
        }
        deltas
    }
}

/// The first part of which each unique vertex is a corner; where no triangle is, any part will do.
fn owners(mesh: &Mesh) -> Vec<u16> {
    let mut owners = vec![u16::MAX; mesh.positions_m.len()];
    let parts = mesh.parts.iter().zip(0..).flat_map(|(p, part)| std::iter::repeat_n(part, p.triangle_count as usize));
    for (corners, part) in mesh.triangles.iter().zip(parts) {
        for owner in corners.map(|v| mesh.unique(v) as usize) {
            owners[owner] = owners[owner].min(part);
        }
    }
    let last = mesh.parts.len().saturating_sub(1) as u16;
    owners.iter_mut().for_each(|owner| *owner = (*owner).min(last));
    owners
}

/// The section `SFLD`, of as many sizes as the fit has.
pub(in crate::pack) fn read(
    garment: &Garment,
    sizes: usize,
    from: &mut Reader<'_>,
) -> Result<Vec<Field>, ContentProblem> {
    let mesh = &garment.data().mesh;
    let (parts, vertices) = (mesh.parts.len(), mesh.positions_m.len());
    let steps_m = (0..parts * sizes).map(|_| from.f32()).collect::<Result<Vec<f32>, _>>()?;
    if parts == 0 {
        return Ok(Vec::new());
    }
    let numbers = (parts * sizes).saturating_mul(vertices);
    if numbers > limits::DELTAS {
        return Err(ContentProblem::Count { what: "deltas", count: numbers, limit: limits::DELTAS });
    }
    from.allow(6 * numbers)?;
    let stored = Stored::new(mesh, sizes);
    let lower = Lower::new(vertices, &mesh.twin_of, &mesh.triangles);
    let read = field::read(from, stored.count(), &stored.runs, &lower, &mesh.positions_m)?;
    let fields = steps_m.into_iter().zip(stored.spread(&read));
    Ok(fields.map(|(step_m, deltas)| Field { step_m, deltas }).collect())
}

/// Writes what [`read`] reads.
#[cfg(feature = "write")]
pub(in crate::pack) fn write(garment: &Garment, fit: &FitData, to: &mut Writer) {
    let mesh = &garment.data().mesh;
    let (parts, sizes) = (mesh.parts.len(), fit.size_count());
    fit.fields.iter().for_each(|field| to.f32(field.step_m));
    if parts == 0 {
        return;
    }
    let stored = Stored::new(mesh, sizes);
    let delta = |part: usize, size: usize, v: usize| fit.fields[part * sizes + size].deltas[v];
    let fields = stored.gathered(|part, size, v| match part {
        Some(part) => delta(part, size, v),
        None => (0..parts).fold([0i16; 3], |sum, part| {
            let delta = delta(part, size, v);
            [0, 1, 2].map(|i| sum[i].wrapping_add(delta[i]))
        }),
    });
    let fields: Vec<&[[i16; 3]]> = fields.iter().map(Vec::as_slice).collect();
    let lower = Lower::new(mesh.positions_m.len(), &mesh.twin_of, &mesh.triangles);
    field::write(&fields, &stored.runs, &lower, &mesh.positions_m, to);
}

/// Whole steps for the fields of the sizes, such that they take few bytes: per part and size one vector per unique vertex. `sums` are
/// per size what is wanted of the sum over the parts, `wanted` per part and size of the parts, in steps. Sums and what is stored of the
/// parts lie within `radius` steps of what is wanted; the last part of each vertex takes what they leave of the sum.
///
/// # Panics
/// When mesh and fields do not fit each other, steps lie outside 16 bits less a few for each part, or as [`field::quantise`].
#[cfg(feature = "write")]
#[must_use]
pub fn quantise(mesh: &Mesh, sums: &[Vec<Vec3>], wanted: &[Vec<Vec3>], radius: f32) -> Vec<Vec<[i16; 3]>> {
    let stored = Stored::new(mesh, sums.len());
    let fields = stored.gathered(|part, size, v| match part {
        Some(part) => wanted[part * sums.len() + size][v],
        None => sums[size][v],
    });
    stored.spread(&field::quantise(mesh, &stored.runs, &fields, radius))
}

/// The section `FLDS`, of as many sizes as the fit has: residuals of the sum over the parts and of every part but the vertex's own,
/// coordinate after coordinate.
pub(in crate::pack) fn read_before_5_3(
    garment: &Garment,
    sizes: usize,
    from: &mut Reader<'_>,
) -> Result<Vec<Field>, ContentProblem> {
    let mesh = &garment.data().mesh;
    let (parts, count) = (mesh.parts.len(), garment.unique_count());
    let steps = (0..parts * sizes).map(|_| from.f32()).collect::<Result<Vec<f32>, _>>()?;
    let length = from.u32()? as usize;
    let bits = from.take(length)?;
    // Before anything is allocated: every value takes a bit at least.
    let values = (parts * sizes).saturating_mul(3 * count);
    if values > 8 * length || values / 3 > limits::DELTAS {
        return Err(ContentProblem::Ends { needed: values.div_ceil(8), left: length });
    }
    from.allow(2 * values)?;
    let owners = owners(mesh);
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|corners| corners.map(|v| mesh.unique(v))).collect();
    let predictor = Predictor::new(count, &triangles);
    let mut fields: Vec<Field> =
        steps.into_iter().map(|step_m| Field { step_m, deltas: vec![[0; 3]; count] }).collect();
    let mut reader = ResidualReader::new(bits, parts + 1);
    // The values of every part, then of their sum.
    let sum = parts;
    let mut known = vec![vec![0i32; count]; if parts == 0 { 0 } else { parts + 1 }];
    for size in 0..if parts == 0 { 0 } else { sizes } {
        for axis in 0..3 {
            for v in 0..count {
                let owner = usize::from(owners[v]);
                known[sum][v] = reader.value(sum, &predictor, v, &known[sum]);
                let mut rest = known[sum][v];
                for part in (0..parts).filter(|part| *part != owner) {
                    known[part][v] = reader.value(part, &predictor, v, &known[part]);
                    rest = rest.wrapping_sub(known[part][v]);
                }
                known[owner][v] = rest;
            }
            for (part, known) in known[..parts].iter().enumerate() {
                for (delta, known) in fields[part * sizes + size].deltas.iter_mut().zip(known) {
                    delta[axis] = *known as i16;
                }
            }
        }
    }
    reader.finish()?;
    Ok(fields)
}
