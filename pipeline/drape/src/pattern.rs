//! A paper pattern: pieces with closed outlines of named runs, grain and notches, and the seams that join runs. Lengths are metres, the warp is +Y. Knows
//! neither form nor forces nor file formats.

use glam::DVec2;

/// A part of an outline between two corners.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// For example `waist`.
    pub name: String,
    /// From corner to corner, both included, at least two.
    pub places_m: Vec<DVec2>,
}

/// A piece of cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// For example `right front`.
    pub name: String,
    /// Counter-clockwise; each begins where the one before ends, the first where the last one does.
    pub runs: Vec<Run>,
    /// Where the grain line is drawn: from below to above, along the warp.
    pub grain_m: [DVec2; 2],
    /// Marks on the outline that seams match.
    pub notches_m: Vec<DVec2>,
}

/// A run of a piece, by numbers.
pub type RunAt = [usize; 2];

/// A pattern.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pattern {
    /// What is cut.
    pub pieces: Vec<Piece>,
    /// What is sewn: the first run's begin onto the second one's end.
    pub seams: Vec<[RunAt; 2]>,
}

/// Why an outline is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PatternError {
    /// Runs that do not meet.
    #[error("{piece}: `{run}` begins {gap_mm:.2} mm from where the run before it ends")]
    Gap {
        /// The piece.
        piece: String,
        /// The run.
        run: String,
        /// Millimetres.
        gap_mm: f64,
    },
    /// An outline that crosses itself or has no area.
    #[error("{piece}: the outline has no area on its left side; it must go round counter-clockwise")]
    Turned {
        /// The piece.
        piece: String,
    },
    /// A run without length or that is not finite.
    #[error("{piece}: `{run}` has no length")]
    Short {
        /// The piece.
        piece: String,
        /// The run.
        run: String,
    },
}

impl Run {
    /// Along it, metres.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.places_m.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
    }

    /// The place at a share of its length.
    #[must_use]
    pub fn at_m(&self, share: f64) -> DVec2 {
        let mut left_m = share.clamp(0.0, 1.0) * self.length_m();
        for pair in self.places_m.windows(2) {
            let side_m = pair[0].distance(pair[1]);
            if left_m <= side_m && side_m > 0.0 {
                return pair[0].lerp(pair[1], left_m / side_m);
            }
            left_m -= side_m;
        }
        self.places_m[self.places_m.len() - 1]
    }

    /// So many places at equal distances along it, at least two, its ends among them.
    #[must_use]
    pub fn divided_m(&self, count: usize) -> Vec<DVec2> {
        (0..count).map(|i| self.at_m(i as f64 / (count - 1) as f64)).collect()
    }

    /// Made as long as is asked by drawing it out along the way from its end `fixed` (0 or 1) to the other, by as little as that takes.
    pub fn make_length(&mut self, length_m: f64, fixed: usize) {
        let ends = [self.places_m[0], self.places_m[self.places_m.len() - 1]];
        let (from_m, way) = (ends[fixed], (ends[1 - fixed] - ends[fixed]).normalize_or_zero());
        // A few rounds of what is missing are exact to rounding: runs are nearly straight.
        for _ in 0..8 {
            let share = length_m / self.length_m() - 1.0;
            for place_m in &mut self.places_m {
                *place_m += way * ((*place_m - from_m).dot(way) * share);
            }
        }
    }
}

impl Piece {
    /// The closed outline, no corner twice, metres.
    #[must_use]
    pub fn outline_m(&self) -> Vec<DVec2> {
        self.runs.iter().flat_map(|run| run.places_m[..run.places_m.len() - 1].iter().copied()).collect()
    }

    /// # Errors
    /// When runs do not meet, have no length, or go round the wrong way.
    pub fn check(&self) -> Result<(), PatternError> {
        for (i, run) in self.runs.iter().enumerate() {
            let name = || (self.name.clone(), run.name.clone());
            if run.places_m.len() < 2 || !(run.length_m() > 0.0 && run.length_m().is_finite()) {
                let (piece, run) = name();
                return Err(PatternError::Short { piece, run });
            }
            let before = &self.runs[(i + self.runs.len() - 1) % self.runs.len()].places_m;
            let gap_mm = 1e3 * run.places_m[0].distance(before[before.len() - 1]);
            if gap_mm > 1e-3 {
                let (piece, run) = name();
                return Err(PatternError::Gap { piece, run, gap_mm });
            }
        }
        if crate::slices::area_m2(&self.outline_m()) <= 0.0 {
            return Err(PatternError::Turned { piece: self.name.clone() });
        }
        Ok(())
    }

    /// The same line gone round the other way.
    #[must_use]
    pub fn backwards(mut self) -> Piece {
        self.runs.reverse();
        self.runs.iter_mut().for_each(|run| run.places_m.reverse());
        self
    }

    /// Turned over along the warp: for the other side of the body.
    #[must_use]
    pub fn mirrored(&self, name: &str) -> Piece {
        let over = |p: &DVec2| DVec2::new(-p.x, p.y);
        let runs = self
            .runs
            .iter()
            .rev()
            .map(|run| Run { name: run.name.clone(), places_m: run.places_m.iter().rev().map(over).collect() });
        Piece {
            name: name.to_owned(),
            runs: runs.collect(),
            grain_m: [over(&self.grain_m[0]), over(&self.grain_m[1])],
            notches_m: self.notches_m.iter().map(over).collect(),
        }
    }
}

impl Pattern {
    /// A run.
    #[must_use]
    pub fn run(&self, [piece, run]: RunAt) -> &Run {
        &self.pieces[piece].runs[run]
    }

    /// How much the two runs of a seam differ in length, metres.
    #[must_use]
    pub fn unequal_m(&self, seam: [RunAt; 2]) -> f64 {
        (self.run(seam[0]).length_m() - self.run(seam[1]).length_m()).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Piece {
        let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let runs = (0..4).map(|i| Run { name: format!("side {i}"), places_m: vec![corners[i], corners[(i + 1) % 4]] });
        Piece {
            name: "square".to_owned(),
            runs: runs.collect(),
            grain_m: [DVec2::ZERO, DVec2::Y],
            notches_m: vec![DVec2::X],
        }
    }

    #[test]
    fn runs_are_measured_divided_and_made_as_long_as_asked() {
        let mut run = Run {
            name: "side".to_owned(),
            places_m: (0..=20)
                .map(|i| DVec2::new(0.02 * libm::sin(0.15 * f64::from(i)), 0.03 * f64::from(i)))
                .collect(),
        };
        let long_m = run.length_m();
        let divided = run.divided_m(7);
        assert!(divided[0] == run.places_m[0] && divided[6].distance(run.places_m[20]) < 1e-12);
        let last_m = run.places_m[20];
        run.make_length(long_m + 0.002, 1);
        assert!((run.length_m() - long_m - 0.002).abs() < 1e-12 && run.places_m[20] == last_m);
        assert!((run.places_m[0].y + 0.002).abs() < 2e-4);
    }

    #[test]
    fn pieces_are_checked_and_turned_over() {
        let piece = square();
        piece.check().unwrap();
        let over = piece.mirrored("over");
        over.check().unwrap();
        assert_eq!((over.runs[0].name.as_str(), over.runs[0].places_m[0]), ("side 3", DVec2::ZERO));
        let mut open = piece.clone();
        open.runs[2].places_m[0].x += 0.01;
        assert_eq!(
            open.check().unwrap_err().to_string(),
            "square: `side 2` begins 10.00 mm from where the run before it ends"
        );
        let mut turned = piece.mirrored("turned");
        turned.runs.iter_mut().for_each(|run| run.places_m.iter_mut().for_each(|p| p.x = -p.x));
        assert!(matches!(turned.check(), Err(PatternError::Turned { .. })));
    }
}
