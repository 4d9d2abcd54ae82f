//! What a cloth is like: the constants of P2's model with units. Knows no mesh.

/// The constants of one cloth. The defaults are a soft cloth that looks right, not a measured one: woven silk stretches
/// about ten times less, which the explicit steps of this model would take a thousand times as long to settle.
#[derive(Clone, Debug, PartialEq)]
pub struct Fabric {
    /// Mass per area, kg/m², above 0. Kimono silk: 0.11 to 0.18.
    pub mass_kg_per_m2: f64,
    /// Tension per width of cloth at a strain of 1 along the warp, N/m, at least 0: `warp strain²`.
    pub warp_n_per_m: f64,
    /// The same along the weft.
    pub weft_n_per_m: f64,
    /// The same on the bias (45°): the shear of the cloth.
    pub bias_n_per_m: f64,
    /// What of these constants counts in compression, 0 to 1: cloth resists less to be shortened (P2, figure 4).
    pub compression: f64,
    /// Torque per length of a crease at 90°, N·m per m, at least 0 (the `c` of P2, eq. 1): high for cotton, low for silk.
    pub bending_n: f64,
    /// How hard the two ends of a sewn pair are drawn together, N/m, at least 0.
    pub thread_n_per_m: f64,
    /// Distance that cloth keeps from itself and from the body, metres, above 0.
    pub thickness_m: f64,
    /// Coefficient of friction of cloth on cloth, at least 0.
    pub friction: f64,
}

impl Default for Fabric {
    fn default() -> Fabric {
        Fabric {
            mass_kg_per_m2: 0.15,
            warp_n_per_m: 3000.0,
            weft_n_per_m: 2500.0,
            bias_n_per_m: 150.0,
            compression: 0.3,
            bending_n: 0.004,
            thread_n_per_m: 1.0,
            thickness_m: 0.003,
            friction: 0.3,
        }
    }
}

/// A constant that is not in its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value}, must be {range}")]
pub struct FabricError {
    /// The field of [`Fabric`] or of the settings.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What it may be, in words.
    pub range: &'static str,
}

/// Whether every constant is finite and in its range.
///
/// # Errors
/// The first that is not.
pub fn check(fabric: &Fabric) -> Result<(), FabricError> {
    above_zero("mass_kg_per_m2", fabric.mass_kg_per_m2)?;
    above_zero("thickness_m", fabric.thickness_m)?;
    for (name, value) in [
        ("warp_n_per_m", fabric.warp_n_per_m),
        ("weft_n_per_m", fabric.weft_n_per_m),
        ("bias_n_per_m", fabric.bias_n_per_m),
        ("bending_n", fabric.bending_n),
        ("thread_n_per_m", fabric.thread_n_per_m),
        ("friction", fabric.friction),
    ] {
        at_least_zero(name, value)?;
    }
    if (0.0..=1.0).contains(&fabric.compression) {
        Ok(())
    } else {
        Err(FabricError { name: "compression", value: fabric.compression, range: "from 0 to 1" })
    }
}

/// Whether a number is finite and above 0.
///
/// # Errors
/// With the name that is given, when it is not.
pub fn above_zero(name: &'static str, value: f64) -> Result<(), FabricError> {
    let is_good = value.is_finite() && value > 0.0;
    if is_good { Ok(()) } else { Err(FabricError { name, value, range: "finite and above 0" }) }
}

/// Whether a number is finite and at least 0.
///
/// # Errors
/// With the name that is given, when it is not.
pub fn at_least_zero(name: &'static str, value: f64) -> Result<(), FabricError> {
    let is_good = value.is_finite() && value >= 0.0;
    if is_good { Ok(()) } else { Err(FabricError { name, value, range: "finite and at least 0" }) }
}
