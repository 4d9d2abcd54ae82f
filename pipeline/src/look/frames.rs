//! Frames for people and other programs: which poses to show, and how their positions are written as NPY and OBJ in
//! the vertex order of the artist's base file. Knows no source file and no folder.

use glam::Vec3;
use kitsuke::pose_blend::Kernel;
use kitsuke::skeleton::Pose;
use kitsuke::{Frame, Garment, Rates, Scratch, evaluate_with_rates};
use std::io::{self, Write};

/// A pose to show, and how its targets are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// For captions and file names.
    pub name: String,
    /// The pose.
    pub pose: Pose,
    /// The targets.
    pub blend: Blend,
}

/// How the targets of a [`Shot`] are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// By this kernel, from the pose.
    Kernel(Kernel),
    /// This target alone at full rate; `None` is the base.
    Alone(Option<usize>),
}

/// The rows of the garment's own pose table, each with only its own target at full rate: the base, then the targets.
#[must_use]
pub fn own_poses(garment: &Garment) -> Vec<Shot> {
    let data = garment.data();
    let samples = &data.targets[..data.sample_count()];
    let names = std::iter::once("base").chain(samples.iter().map(|target| target.name.as_str()));
    let shot = |(row, name): (usize, &str)| Shot {
        name: name.to_owned(),
        pose: data.poses.pose(row),
        blend: Blend::Alone(row.checked_sub(1)),
    };
    names.enumerate().map(shot).collect()
}

/// One garment with the buffers that its frames need.
#[derive(Clone, Debug)]
pub struct Stage<'a> {
    garment: &'a Garment,
    scratch: Scratch,
    rates: Rates,
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl<'a> Stage<'a> {
    /// Buffers for this garment.
    #[must_use]
    pub fn new(garment: &'a Garment) -> Stage<'a> {
        let zeros = vec![Vec3::ZERO; garment.vertex_count()];
        let (scratch, rates) = (Scratch::new(garment), Rates::new(garment.data()));
        Stage { garment, scratch, rates, positions_m: zeros.clone(), normals: zeros }
    }

    /// Positions (metres) and unit normals of all vertices, seam twins included, in the pack's order.
    ///
    /// # Panics
    /// When the shot shows a target that the garment does not have.
    pub fn show(&mut self, shot: &Shot) -> (&[Vec3], &[Vec3]) {
        let frame = Frame { positions_m: &mut self.positions_m, normals: &mut self.normals };
        match shot.blend {
            // As the runtime does: the rates are those of the pose with usable numbers.
            Blend::Kernel(kernel) => self.garment.blend_rates(kernel, &shot.pose.sanitised(), &mut self.rates),
            Blend::Alone(target) => {
                self.rates.clear();
                for driver in 0..self.garment.data().drivers.len() {
                    target.into_iter().for_each(|target| self.rates.set(driver, target, 1.0));
                }
            }
        }
        evaluate_with_rates(self.garment, &shot.pose, &self.rates, &mut self.scratch, frame);
        (&self.positions_m, &self.normals)
    }
}

/// The unique vertices of a frame in the order of the base file.
///
/// # Panics
/// When `positions_m` is shorter than the garment's unique vertices.
#[must_use]
pub fn in_source_order(garment: &Garment, positions_m: &[Vec3]) -> Vec<Vec3> {
    let mut ordered_m = vec![Vec3::ZERO; garment.unique_count()];
    for (&source, &position_m) in garment.data().mesh.source_vertex.iter().zip(&positions_m[..garment.unique_count()]) {
        ordered_m[source as usize] = position_m;
    }
    ordered_m
}

/// The header of an NPY file (version 1.0) of little-endian float32 in C order; the numbers follow.
#[must_use]
pub fn npy_header(shape: &[usize]) -> Vec<u8> {
    npy_header_of("<f4", shape)
}

/// The same for elements of another type, as numpy names it: `|b1` are truth values, one byte each.
#[must_use]
pub fn npy_header_of(descr: &str, shape: &[usize]) -> Vec<u8> {
    // As Python writes a tuple: one number alone has a comma behind it.
    let comma = if shape.len() == 1 { "," } else { "" };
    let shape = shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ") + comma;
    let mut text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Magic, version and length take 10 bytes; numpy wants the data at a multiple of 64.
    let padded = (10 + text.len() + 1).next_multiple_of(64) - 10;
    text.extend(std::iter::repeat_n(' ', padded - 1 - text.len()));
    text.push('\n');
    let length = u16::try_from(padded).expect("the header is short").to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes()].concat()
}

/// The numbers of one frame: x, y, z per vertex.
#[must_use]
pub fn npy_frame(positions_m: &[Vec3]) -> Vec<u8> {
    positions_m.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect()
}

/// Writes a frame as OBJ, metres: the base file's vertex numbers, one texture coordinate per vertex of the pack, the
/// parts as groups. `ordered_m` comes from [`in_source_order`].
///
/// # Errors
/// Those of `out`.
///
/// # Panics
/// When `ordered_m` is not as long as the garment's unique vertices.
pub fn write_obj(garment: &Garment, ordered_m: &[Vec3], out: &mut impl Write) -> io::Result<()> {
    let mesh = &garment.data().mesh;
    assert_eq!(ordered_m.len(), garment.unique_count(), "one position per unique vertex");
    for p in ordered_m {
        writeln!(out, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z)?;
    }
    for uv in &mesh.uv {
        writeln!(out, "vt {:.6} {:.6}", uv.x, uv.y)?;
    }
    let corner = |vertex: u32| {
        let unique = mesh.unique(vertex);
        let v = mesh.source_vertex[unique as usize] + 1;
        if mesh.uv.is_empty() { v.to_string() } else { format!("{v}/{}", vertex + 1) }
    };
    let mut triangles = mesh.triangles.iter();
    for part in &mesh.parts {
        writeln!(out, "g {}", part.name)?;
        for triangle in triangles.by_ref().take(part.triangle_count as usize) {
            let [a, b, c] = triangle.map(corner);
            writeln!(out, "f {a} {b} {c}")?;
        }
    }
    Ok(())
}

/// How far one set of positions lies from another, vertex by vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distance {
    /// The largest, metres.
    pub max_m: f32,
    /// The mean over all vertices, metres.
    pub mean_m: f32,
    /// The vertex of the largest.
    pub vertex: usize,
}

impl Distance {
    /// Compares two lists of positions; 0 where both are empty.
    ///
    /// # Panics
    /// When they differ in length.
    #[must_use]
    pub fn between(a_m: &[Vec3], b_m: &[Vec3]) -> Distance {
        assert_eq!(a_m.len(), b_m.len(), "vertex by vertex");
        let (mut distance, mut sum) = (Distance::default(), 0.0f64);
        for (vertex, (a, b)) in a_m.iter().zip(b_m).enumerate() {
            let d = a.distance(*b);
            sum += f64::from(d);
            // What is no number counts as the largest.
            if d > distance.max_m || d.is_nan() {
                distance = Distance { max_m: d, vertex, ..distance };
            }
        }
        distance.mean_m = (sum / a_m.len().max(1) as f64) as f32;
        distance
    }
}
