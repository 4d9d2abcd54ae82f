//! What a caller may decide where a BVH file leaves it open. Knows no file.

use glam::DVec3;

/// What is decided beforehand; by default nothing, and the file's own evidence counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// Which of the file's axes points up (`--up`).
    pub up: Option<Axis>,
    /// Where the T-pose comes from (`--rest`).
    pub rest: Option<Rest>,
}

/// What serves as the T-pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rest {
    /// The OFFSETs; arms that they do not hold sideways are turned there.
    Offsets,
    /// The first frame; arms that it does not hold sideways are turned there.
    FirstFrame,
    /// Where bones point in the world, over all frames.
    Directions,
}

impl std::str::FromStr for Rest {
    type Err = String;

    /// Reads `offsets`, `first-frame` or `directions`.
    fn from_str(text: &str) -> Result<Rest, String> {
        match text {
            "offsets" => Ok(Rest::Offsets),
            "first-frame" => Ok(Rest::FirstFrame),
            "directions" => Ok(Rest::Directions),
            _ => Err("the T-pose comes from offsets, first-frame or directions".to_owned()),
        }
    }
}

/// An axis of a file, with its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// `+X`.
    PlusX,
    /// `-X`.
    MinusX,
    /// `+Y`, up by the format's custom.
    PlusY,
    /// `-Y`.
    MinusY,
    /// `+Z`, up in modellers.
    PlusZ,
    /// `-Z`.
    MinusZ,
}

impl Axis {
    /// All of them.
    pub const ALL: [Axis; 6] = [Axis::PlusX, Axis::MinusX, Axis::PlusY, Axis::MinusY, Axis::PlusZ, Axis::MinusZ];

    /// As it is written: a sign and a capital letter.
    #[must_use]
    pub fn name(self) -> &'static str {
        ["+X", "-X", "+Y", "-Y", "+Z", "-Z"][self as usize]
    }

    /// Of length 1.
    #[must_use]
    pub fn vector(self) -> DVec3 {
        let axis = DVec3::AXES[self as usize / 2];
        if (self as usize).is_multiple_of(2) { axis } else { -axis }
    }

    /// The axis nearest to a direction.
    pub(super) fn nearest(direction: DVec3) -> Axis {
        let along = |axis: &Axis| axis.vector().dot(direction);
        Axis::ALL.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(Axis::PlusY)
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Axis {
    type Err = String;

    /// Reads `+Z`, `z` or `-y`.
    fn from_str(text: &str) -> Result<Axis, String> {
        let signed = if text.starts_with(['+', '-']) { text.to_owned() } else { format!("+{text}") };
        let found = Axis::ALL.into_iter().find(|axis| axis.name().eq_ignore_ascii_case(&signed));
        found.ok_or_else(|| "an axis is one of +X, -X, +Y, -Y, +Z and -Z".to_owned())
    }
}
