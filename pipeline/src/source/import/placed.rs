//! An imported mesh in metres, Y up, front +Z: by what its file says, and by what somebody says who knows better. Knows neither manifest
//! nor command line.

use super::{Axes, ImportedMesh};
use crate::source::units::LengthUnit;
use glam::{DMat3, DVec3};

/// What somebody says of a mesh; it counts before what its file says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Said {
    /// Its unit.
    pub unit: Option<LengthUnit>,
    /// Its axis that points up, a unit vector.
    pub up: Option<DVec3>,
    /// Its axis that points to the wearer's front, a unit vector.
    pub front: Option<DVec3>,
}

/// A mesh's positions where they are.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Metres, Y up, front +Z.
    pub positions_m: Vec<DVec3>,
    /// Whether the front is known; else it is only the usual one.
    pub knows_front: bool,
    /// What takes places of the file there.
    pub metres_from_file: DMat3,
}

/// Why nobody knows where a mesh is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unplaced {
    /// Neither file nor anybody says the unit.
    #[error("the scan does not say its unit")]
    NoUnit,
    /// Up and front lie along one axis.
    #[error("the scan's `up` and `front` are one axis")]
    OneAxis,
}

/// Positions in metres. Who says another `up` than the file does not believe its axes: then its front counts no more, either.
///
/// # Errors
/// The unit is not known, or the axes are none.
pub fn placed(mesh: &ImportedMesh, said: &Said) -> Result<Placed, Unplaced> {
    let unit_m = said.unit.map(LengthUnit::metres).or(mesh.unit_m).ok_or(Unplaced::NoUnit)?;
    let believed = mesh.axes.filter(|axes| said.up.is_none_or(|up| up == axes.up));
    let up = said.up.or(believed.map(|axes| axes.up)).unwrap_or(DVec3::Y);
    let front = said.front.or(believed.map(|axes| axes.front));
    let Axes { up, front: toward } = Axes { up, front: front.unwrap_or_else(|| usual_front(up)) };
    if up.dot(toward) != 0.0 {
        return Err(Unplaced::OneAxis);
    }
    let left = up.cross(toward);
    let metres_from_file = DMat3::from_cols(left, up, toward).transpose() * unit_m;
    let positions_m = mesh.positions.iter().map(|&p| metres_from_file * p).collect();
    Ok(Placed { positions_m, knows_front: front.is_some(), metres_from_file })
}

/// Where the front is in programs that stand things so.
fn usual_front(up: DVec3) -> DVec3 {
    if up.z == 0.0 { DVec3::Z } else { DVec3::NEG_Y }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a mesh's point 1 2 3 comes to, millimetres, and whether the front is known.
    fn at(axes: Option<Axes>, up: Option<DVec3>, front: Option<DVec3>) -> Result<([f64; 3], bool), Unplaced> {
        let mesh = ImportedMesh { positions: vec![DVec3::new(1.0, 2.0, 3.0)], axes, ..ImportedMesh::default() };
        let placed = placed(&mesh, &Said { unit: Some(LengthUnit::Mm), up, front })?;
        Ok(((placed.positions_m[0] * 1e3).to_array(), placed.knows_front))
    }

    #[test]
    fn what_is_said_counts_before_what_the_file_says() {
        let of_file = Some(Axes { up: DVec3::Y, front: DVec3::X });
        assert_eq!(at(None, None, None), Ok(([1.0, 2.0, 3.0], false)), "the usual axes");
        assert_eq!(at(of_file, None, None), Ok(([-3.0, 2.0, 1.0], true)));
        assert_eq!(at(of_file, Some(DVec3::Y), None), Ok(([-3.0, 2.0, 1.0], true)), "both say the same of up");
        assert_eq!(at(of_file, Some(DVec3::Z), None), Ok(([1.0, 3.0, -2.0], false)), "the file is not believed");
        assert_eq!(at(of_file, Some(DVec3::Z), Some(DVec3::Y)), Ok(([-1.0, 3.0, 2.0], true)));
        assert_eq!(at(of_file, None, Some(DVec3::NEG_Z)), Ok(([-1.0, 2.0, -3.0], true)));
        assert_eq!(at(None, Some(DVec3::NEG_Z), None), Ok(([-1.0, -3.0, -2.0], false)));
    }

    #[test]
    fn what_nobody_says_is_not_guessed() {
        assert_eq!(at(None, None, Some(DVec3::NEG_Y)), Err(Unplaced::OneAxis));
        assert_eq!(placed(&ImportedMesh::default(), &Said::default()), Err(Unplaced::NoUnit));
    }
}
