//! The frames of engines: what becomes of places, rotations and windings. All map the wearer's front, left and up to where engines
//! put them when they import glTF.

use crate::status::{Failure, Status};
use kitsuke::glam::{Quat, Vec2, Vec3};

/// In which axes places and poses go in and come out.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// glTF, VRM, three.js, Godot: right-handed, metres, Y up, front +Z, the wearer's left +X; outside is counter-clockwise.
    Gltf = 0,
    /// Unity, as UniVRM for VRM 1.0 and glTFast import: left-handed, metres, Y up, front +Z, left -X; outside is clockwise.
    Unity = 1,
    /// Unreal, as its glTF importer: left-handed, centimetres, Z up, front +Y, left +X; outside is clockwise.
    Unreal = 2,
}

impl Axes {
    /// As a caller names them: a number from C may be any.
    pub(crate) fn of(code: i32) -> Result<Axes, Failure> {
        let known = [Axes::Gltf, Axes::Unity, Axes::Unreal].into_iter().find(|axes| *axes as i32 == code);
        known.ok_or_else(|| (Status::Range, format!("there are no axes {code}")))
    }

    /// A place, from the garment's space.
    pub(crate) fn place(self, p: Vec3) -> Vec3 {
        match self {
            Axes::Gltf => p,
            Axes::Unity => Vec3::new(-p.x, p.y, p.z),
            Axes::Unreal => Vec3::new(p.x, p.z, p.y) * 100.0,
        }
    }

    /// A place, into the garment's space.
    pub(crate) fn place_back(self, p: Vec3) -> Vec3 {
        match self {
            Axes::Gltf => p,
            Axes::Unity => Vec3::new(-p.x, p.y, p.z),
            Axes::Unreal => Vec3::new(p.x, p.z, p.y) * 0.01,
        }
    }

    /// A direction, from the garment's space.
    pub(crate) fn direction(self, d: Vec3) -> Vec3 {
        match self {
            Axes::Gltf => d,
            Axes::Unity => Vec3::new(-d.x, d.y, d.z),
            Axes::Unreal => Vec3::new(d.x, d.z, d.y),
        }
    }

    /// A rotation, to or from the garment's space: a mirror turns the other way round, and each of these is its own inverse.
    pub(crate) fn rotation(self, q: Quat) -> Quat {
        match self {
            Axes::Gltf => q,
            Axes::Unity => Quat::from_xyzw(q.x, -q.y, -q.z, q.w),
            Axes::Unreal => Quat::from_xyzw(-q.x, -q.z, -q.y, q.w),
        }
    }

    /// A triangle's corners, outside as the engine has it.
    pub(crate) fn triangle(self, [a, b, c]: [u32; 3]) -> [u32; 3] {
        match self {
            Axes::Gltf => [a, b, c],
            Axes::Unity | Axes::Unreal => [a, c, b],
        }
    }

    /// A texture coordinate: v from the top in glTF and Unreal, from the bottom in Unity.
    pub(crate) fn uv(self, uv: Vec2) -> Vec2 {
        match self {
            Axes::Unity => uv,
            Axes::Gltf | Axes::Unreal => Vec2::new(uv.x, 1.0 - uv.y),
        }
    }
}
