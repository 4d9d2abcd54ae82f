//! A pattern cut and sewn: each piece as a mesh ([`cut`]), the runs of a seam with equally many places, which become one particle each. Knows neither
//! form nor forces.

use crate::cut::{CutError, cut};
use crate::pattern::Pattern;
use crate::slices::area_m2;
use glam::DVec2;

/// Runs that differ by more than this are eased only if that is told, metres.
const EQUAL_M: f64 = 5e-4;

/// Cut pieces one after another, and what is sewn.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sewn {
    /// Of each vertex in its piece, metres.
    pub places_m: Vec<DVec2>,
    /// Which piece it belongs to.
    pub pieces: Vec<usize>,
    /// Counter-clockwise, three vertices each.
    pub triangles: Vec<[u32; 3]>,
    /// For each piece, for each of its runs, the vertices along it.
    pub runs: Vec<Vec<Vec<u32>>>,
    /// Pairs of vertices that become one.
    pub welds: Vec<[u32; 2]>,
    /// Least angle of a triangle, radians.
    pub least_rad: f64,
}

/// Why a pattern is not sewn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SewError {
    /// A piece that is not cut.
    #[error("{piece}: {error}")]
    Cut {
        /// Which.
        piece: String,
        /// Why.
        error: CutError,
    },
    /// A seam of what is not there.
    #[error("seam {seam} joins run {run} of piece {piece}, which is not there")]
    Missing {
        /// Which seam, from 0.
        seam: usize,
        /// Which piece.
        piece: usize,
        /// Which run.
        run: usize,
    },
    /// A run that is in two seams.
    #[error("{piece}: `{run}` is sewn twice")]
    Twice {
        /// The piece.
        piece: String,
        /// The run.
        run: String,
    },
    /// Runs that are not equally long.
    #[error("{first} and {second} are to be sewn, but differ by {differ_mm:.1} mm: true the seam, or allow ease")]
    Unequal {
        /// A piece's run.
        first: String,
        /// The other one.
        second: String,
        /// Millimetres.
        differ_mm: f64,
    },
}

/// Cuts and sews with edges of about `edge_m`. Runs of a seam may differ by up to half a millimetre, or by `ease_m`, which is spread evenly.
///
/// # Errors
/// When a piece cannot be cut, or a seam joins what is not there, is sewn already, or differs in length.
pub fn sew(pattern: &Pattern, edge_m: f64, ease_m: f64) -> Result<Sewn, SewError> {
    let parts = |length_m: f64| (length_m / edge_m).round().max(1.0) as usize;
    let mut counts: Vec<Vec<usize>> =
        pattern.pieces.iter().map(|piece| piece.runs.iter().map(|run| parts(run.length_m())).collect()).collect();
    let mut is_sewn: Vec<Vec<bool>> = counts.iter().map(|runs| vec![false; runs.len()]).collect();
    for (seam, ends) in pattern.seams.iter().enumerate() {
        for [piece, run] in *ends {
            let sewn = is_sewn.get_mut(piece).and_then(|runs| runs.get_mut(run));
            let sewn = sewn.ok_or(SewError::Missing { seam, piece, run })?;
            if std::mem::replace(sewn, true) {
                let piece = &pattern.pieces[piece];
                return Err(SewError::Twice { piece: piece.name.clone(), run: piece.runs[run].name.clone() });
            }
        }
        let differ_m = pattern.unequal_m(*ends);
        if differ_m > EQUAL_M.max(ease_m) {
            let [first, second] = ends.map(|[piece, run]| {
                format!("{}'s {}", pattern.pieces[piece].name, pattern.pieces[piece].runs[run].name)
            });
            return Err(SewError::Unequal { first, second, differ_mm: 1e3 * differ_m });
        }
        let [[piece, run], [other, beside]] = *ends;
        let count = counts[piece][run].max(counts[other][beside]);
        (counts[piece][run], counts[other][beside]) = (count, count);
    }
    let mut sewn = Sewn { least_rad: f64::INFINITY, ..Sewn::default() };
    for (number, piece) in pattern.pieces.iter().enumerate() {
        let first = sewn.places_m.len() as u32;
        let (mut outline, mut runs) = (Vec::new(), Vec::new());
        for (run, count) in piece.runs.iter().zip(&counts[number]) {
            let begin = first + outline.len() as u32;
            outline.extend_from_slice(&run.divided_m(count + 1)[..*count]);
            runs.push((0..=*count as u32).map(|i| begin + i).collect::<Vec<u32>>());
        }
        // The last run ends where the first begins.
        if let Some(end) = runs.last_mut().and_then(|run| run.last_mut()) {
            *end = first;
        }
        let mesh = cut(&[&outline], edge_m).map_err(|error| SewError::Cut { piece: piece.name.clone(), error })?;
        debug_assert!(area_m2(&outline) > 0.0);
        sewn.pieces.extend(mesh.places_m.iter().map(|_| number));
        sewn.places_m.extend(mesh.places_m);
        sewn.triangles.extend(mesh.triangles.iter().map(|corners| corners.map(|v| v + first)));
        sewn.least_rad = sewn.least_rad.min(mesh.least_rad);
        sewn.runs.push(runs);
    }
    for [[piece, run], [other, beside]] in &pattern.seams {
        let (there, back) = (&sewn.runs[*piece][*run], &sewn.runs[*other][*beside]);
        let pairs = there.iter().zip(back.iter().rev()).map(|(a, b)| [*a, *b]);
        sewn.welds.extend(pairs.filter(|[a, b]| a != b));
    }
    Ok(sewn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::{Piece, Run};

    /// Two rectangles, 10 cm wide, `high_m` and 20 cm high, sewn side to side.
    fn two(high_m: f64) -> Pattern {
        let piece = |name: &str, high_m: f64| {
            let corners = [DVec2::ZERO, DVec2::X * 0.1, DVec2::new(0.1, high_m), DVec2::Y * high_m];
            let names = ["hem", "right", "top", "left"];
            let runs =
                (0..4).map(|i| Run { name: names[i].to_owned(), places_m: vec![corners[i], corners[(i + 1) % 4]] });
            Piece {
                name: name.to_owned(),
                runs: runs.collect(),
                grain_m: [DVec2::ZERO, DVec2::Y],
                notches_m: Vec::new(),
            }
        };
        Pattern { pieces: vec![piece("front", high_m), piece("back", 0.2)], seams: vec![[[0, 1], [1, 3]]] }
    }

    #[test]
    fn seams_join_as_many_places_from_end_to_end() {
        let sewn = sew(&two(0.2), 0.02, 0.0).unwrap();
        assert_eq!(sewn.welds.len(), 11);
        for [a, b] in &sewn.welds {
            let (a, b) = (sewn.places_m[*a as usize], sewn.places_m[*b as usize]);
            assert!((a - DVec2::X * 0.1).distance(b) < 1e-12 && b.x.abs() < 1e-12, "{a} {b}");
        }
        let area: f64 = sewn.triangles.iter().map(|t| area_m2(&t.map(|v| sewn.places_m[v as usize]))).sum();
        assert!((area - 0.04).abs() < 1e-12 && sewn.least_rad.to_degrees() > 20.0);
        assert!(
            sewn.triangles.iter().all(|t| t.iter().all(|v| sewn.pieces[*v as usize] == sewn.pieces[t[0] as usize]))
        );
    }

    #[test]
    fn what_cannot_be_sewn_is_said() {
        let error = sew(&two(0.21), 0.02, 0.0).unwrap_err();
        assert_eq!(
            error.to_string(),
            "front's right and back's left are to be sewn, but differ by 10.0 mm: true the seam, or allow ease"
        );
        let eased = sew(&two(0.21), 0.02, 0.02).unwrap();
        assert_eq!(eased.welds.len(), 12);
        let mut pattern = two(0.2);
        pattern.seams.push([[0, 1], [1, 1]]);
        assert!(matches!(sew(&pattern, 0.02, 0.0), Err(SewError::Twice { .. })));
        pattern.seams[1] = [[0, 9], [1, 1]];
        assert_eq!(sew(&pattern, 0.02, 0.0), Err(SewError::Missing { seam: 1, piece: 0, run: 9 }));
    }
}
