//! The kimono of one wearer: fitted, its texture corrected, its pose targets transferred.

use super::texture::{TextureError, TextureScratch, Texturer};
use super::{Fit, FitData, FitError, Fitter, Scratch, Transfer};
use crate::arrays::{GarmentData, InvalidGarment};
use crate::envelope_cholesky::FactorError;
use crate::garment::Garment;
use crate::measurement::Measurements;
use glam::Vec3;

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
pub enum TailorError {
    /// What the rules need is not known, or the data do not fit the garment.
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

/// Makes kimonos for any number of wearers from one garment; threads share it. Whoever only wants dimensions and verdicts needs a
/// [`Fitter`] alone.
#[derive(Clone, Debug)]
pub struct Tailor {
    fitter: Fitter,
    transfer: Transfer,
    /// None where the sizes have no texture coordinates.
    texturer: Option<Texturer>,
}

impl Tailor {
    /// Prepares everything that does not depend on the wearer.
    ///
    /// # Errors
    /// When the data do not fit the garment, or its cloth is too entangled to be solved for.
    pub fn new(garment: &Garment, data: FitData) -> Result<Tailor, TailorError> {
        let fitter = Fitter::new(garment, data)?;
        let mesh = &garment.data().mesh;
        let texturer = (!fitter.data().uv.is_empty()).then(|| Texturer::new(mesh, fitter.data())).transpose()?;
        Ok(Tailor { fitter, transfer: Transfer::new(garment)?, texturer })
    }

    /// What finds the sizes.
    #[must_use]
    pub fn fitter(&self) -> &Fitter {
        &self.fitter
    }

    /// The kimono of a wearer by one of the garment's rule sets (an index in [`FitData::rules`]; 0 is its own). `garment` must be that
    /// of [`Tailor::new`]. Takes a fraction of a second: once per wearer.
    ///
    /// # Errors
    /// When a measurement is missing that the rules need.
    pub fn fitted(&self, garment: &Garment, wearer: &Measurements, rules: usize) -> Result<Fitted, TailorError> {
        let fit = self.fitter.fit(wearer, rules, &mut Scratch::default())?;
        Ok(Fitted { garment: self.made(garment, &fit)?, fit })
    }

    /// The kimono of a fit that [`Tailor::fitter`] found.
    ///
    /// # Errors
    /// When what comes out is no garment.
    pub fn made(&self, garment: &Garment, fit: &Fit) -> Result<Garment, TailorError> {
        let mut positions_m = vec![Vec3::ZERO; garment.unique_count()];
        self.fitter.shape(fit, &mut positions_m);
        let joints_m = self.fitter.data().joints_m(&fit.neighbours);
        let tailored = self.transfer.tailored(garment, &positions_m, &joints_m)?;
        let Some(texturer) = &self.texturer else { return Ok(tailored) };
        let mut data: GarmentData = tailored.data().clone();
        texturer.correct(&positions_m, &fit.weights, &mut TextureScratch::new(texturer), &mut data.mesh.uv);
        Ok(Garment::new(data)?)
    }
}
