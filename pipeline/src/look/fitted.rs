//! The kimono of one wearer: fitted, its texture corrected, its pose targets transferred. Knows no files and no tables.

use glam::{Vec2, Vec3};
use kitsuke::arrays::{GarmentData, InvalidGarment};
use kitsuke::envelope_cholesky::FactorError;
use kitsuke::fit::texture::{TextureError, TextureScratch, Texturer};
use kitsuke::fit::{Fit, FitError, Fitter, Scratch, Transfer};
use kitsuke::garment::Garment;
use kitsuke::measurement::Measurements;

/// A fitted kimono that can be posed.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// What the fit says of its dimensions.
    pub fit: Fit,
    /// Shape, texture coordinates, skeleton and targets are the wearer's.
    pub garment: Garment,
}

/// Why there is no kimono for a wearer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FittedError {
    /// What the rules need is not known.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The texture's islands cannot be solved for.
    #[error(transparent)]
    Texture(#[from] TextureError),
    /// The cloth that targets move cannot be solved for.
    #[error("the pose targets cannot be transferred: {0}")]
    Transfer(#[from] FactorError),
    /// What came out is no garment.
    #[error("the fitted kimono cannot be posed: {0}")]
    Invalid(#[from] InvalidGarment),
}

/// Fits a kimono to a wearer by the rule set at `rules` in [`Fitter::data`]; `fitter` must be that of `garment`.
///
/// # Errors
/// When a measurement is missing that the rules need, or the cloth is too entangled to be solved for.
pub fn fitted(garment: &Garment, fitter: &Fitter, wearer: &Measurements, rules: usize) -> Result<Fitted, FittedError> {
    let fit = fitter.fit(wearer, rules, &mut Scratch::default())?;
    let mut positions_m = vec![Vec3::ZERO; garment.unique_count()];
    fitter.shape(&fit, &mut positions_m);
    let uv = corrected_uv(garment, fitter, &fit, &positions_m)?;
    let joints_m = fitter.data().joints_m(&fit.neighbours);
    let tailored = Transfer::new(garment)?.tailored(garment, &positions_m, &joints_m)?;
    let mut data: GarmentData = tailored.data().clone();
    data.mesh.uv = uv;
    Ok(Fitted { fit, garment: Garment::new(data)? })
}

/// Texture coordinates of all vertices, twins included; the base's own where the sizes have none.
fn corrected_uv(
    garment: &Garment,
    fitter: &Fitter,
    fit: &Fit,
    positions_m: &[Vec3],
) -> Result<Vec<Vec2>, TextureError> {
    let mut uv = garment.data().mesh.uv.clone();
    if !fitter.data().uv.is_empty() {
        let texturer = Texturer::new(&garment.data().mesh, fitter.data())?;
        texturer.correct(positions_m, &fit.weights, &mut TextureScratch::new(&texturer), &mut uv);
    }
    Ok(uv)
}
