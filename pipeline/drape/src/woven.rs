//! What woven cloth is like, in the units that textile laboratories measure (Kawabata's evaluation system), for the solver of `drape`.
//! Knows no mesh.

use crate::fabric::{FabricError, above_zero, at_least_zero};

/// A cloth. Stretch and shear are linear: the tangent at the load of a garment's own weight (5 N/m), not at a laboratory's 490 N/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Woven {
    /// Mass per area, kg/m², above 0.
    pub mass_kg_per_m2: f64,
    /// Tension per width of cloth and strain along the warp, N/m, above 0.
    pub warp_n_per_m: f64,
    /// The same along the weft.
    pub weft_n_per_m: f64,
    /// Shear force per width and radian, N/m, above 0. One gf/(cm degree) is 56.2 N/m.
    pub shear_n_per_m: f64,
    /// Bending moment per width and curvature where the warp threads bend, N·m, at least 0. One gf cm²/cm is 9.807e-5 N·m.
    pub warp_bending_nm: f64,
    /// The same where the weft threads bend.
    pub weft_bending_nm: f64,
    /// Distance that two layers keep, metres, above 0.
    pub thickness_m: f64,
    /// Coulomb's coefficient of cloth on cloth, at least 0.
    pub friction: f64,
    /// Coulomb's coefficient of cloth on a body.
    pub body_friction: f64,
}

/// Cloths that kimono are made of. Weights and bending lie in the ranges that dealers and papers give; stretch is that of 4 % at 490 N/m under a
/// parabolic law. **Uncalibrated**: no roll was measured for them.
pub const PRESETS: [(&str, Woven); 5] = [
    ("chirimen", Woven::of(0.145, 2500.0, 1800.0, 25.0, [4.4e-6, 8.8e-6])),
    ("tsumugi", Woven::of(0.125, 2800.0, 2400.0, 36.0, [9.8e-6, 9.8e-6])),
    ("omeshi", Woven::of(0.155, 2800.0, 2200.0, 45.0, [1.4e-5, 1.4e-5])),
    ("yukata", Woven::of(0.125, 3500.0, 3000.0, 50.0, [7.4e-6, 7.4e-6])),
    ("obi", Woven::of(0.35, 8000.0, 8000.0, 100.0, [1.2e-4, 1.2e-4])),
];

impl Woven {
    const fn of(mass: f64, warp: f64, weft: f64, shear: f64, [warp_bending, weft_bending]: [f64; 2]) -> Woven {
        Woven {
            mass_kg_per_m2: mass,
            warp_n_per_m: warp,
            weft_n_per_m: weft,
            shear_n_per_m: shear,
            warp_bending_nm: warp_bending,
            weft_bending_nm: weft_bending,
            thickness_m: 0.0015,
            friction: 0.25,
            body_friction: 0.3,
        }
    }

    /// One of [`PRESETS`].
    #[must_use]
    pub fn preset(name: &str) -> Option<Woven> {
        PRESETS.iter().find(|preset| preset.0 == name).map(|preset| preset.1)
    }

    /// Whether every constant is finite and in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub fn check(&self) -> Result<(), FabricError> {
        for (name, value) in [
            ("mass_kg_per_m2", self.mass_kg_per_m2),
            ("warp_n_per_m", self.warp_n_per_m),
            ("weft_n_per_m", self.weft_n_per_m),
            ("shear_n_per_m", self.shear_n_per_m),
            ("thickness_m", self.thickness_m),
        ] {
            above_zero(name, value)?;
        }
        for (name, value) in [
            ("warp_bending_nm", self.warp_bending_nm),
            ("weft_bending_nm", self.weft_bending_nm),
            ("friction", self.friction),
            ("body_friction", self.body_friction),
        ] {
            at_least_zero(name, value)?;
        }
        Ok(())
    }
}

impl Default for Woven {
    /// Chirimen.
    fn default() -> Woven {
        PRESETS[0].1
    }
}
