//! A laid-on half of the skirt relaxed as in the papers (P3, 2.2.1, with the forces of P2): tension, shear, bending, gravity and a weak pressure, lines
//! held, the form as depth maps; and how far from there `drape` brings the same half. Knows no files and no clocks.
//!
//! P3 also names a twist stiffness of triangles, without a formula; there is none here.

use crate::body::Body;
use crate::certificate::{Bounds, Certificate, certify};
use crate::depth_maps::DepthMaps;
use crate::drape::strain;
use crate::fabric::Fabric;
use crate::relax::{Rested, Settings, State, check, to_rest};
use crate::skirt::{Half, SkirtError};
use glam::DVec3;

/// How a half is relaxed by forces.
#[derive(Clone, Copy, Debug)]
pub struct Relaxing<'a> {
    /// The form, farther out by what `drape` keeps from it beyond the cloth's thickness.
    pub form: &'a DepthMaps,
    /// The form as a body, for the certificate.
    pub body: &'a Body,
    /// The cloth.
    pub fabric: &'a Fabric,
    /// How steps are taken.
    pub settings: &'a Settings,
    /// What is rest, in weights of a particle; and after how many steps it ends without.
    pub residual_weights: f64,
    /// See above.
    pub most_steps: usize,
}

/// Where a half came.
#[derive(Clone, Debug)]
pub struct Relaxed {
    /// Of each vertex of the flat cloth, metres.
    pub places_m: Vec<DVec3>,
    /// How it came to rest.
    pub rested: Rested,
    /// Mean strain along warp and weft.
    pub strain_mean: f64,
    /// Of each particle its distance from where `drape` brought it ([`Half::rests_m`]), metres, ascending.
    pub from_drape_m: Vec<f64>,
    /// Whether it is outside the form and clear of itself; of speeds it says nothing, for this model has none.
    pub certificate: Certificate,
}

/// Relaxes a half from where [`Half::relax`] begins, with the same lines held.
///
/// # Errors
/// When a constant or a setting is not in its range, or the cloth is too thick for its mesh.
pub fn by_forces(half: &Half, relaxing: &Relaxing) -> Result<Relaxed, SkirtError> {
    let Relaxing { form, body, fabric, settings, residual_weights, most_steps } = *relaxing;
    check(settings)?;
    let (sheet, start_m) = half.held()?;
    let mut state = State::new(&sheet, fabric)?;
    state.positions_m = start_m;
    let rested = to_rest(&sheet, fabric, Some(form), settings, residual_weights, most_steps, &mut state);
    let relaxed_m = state.positions_m;
    let mut drape_m = vec![DVec3::ZERO; relaxed_m.len()];
    for (particle, rests_m) in sheet.particle_of_vertex().iter().zip(&half.rests_m) {
        drape_m[*particle as usize] = *rests_m;
    }
    let mut from_drape_m: Vec<f64> = relaxed_m.iter().zip(&drape_m).map(|(a, b)| a.distance(*b)).collect();
    from_drape_m.sort_by(f64::total_cmp);
    let still = vec![0.0; relaxed_m.len()];
    Ok(Relaxed {
        places_m: sheet.particle_of_vertex().iter().map(|particle| relaxed_m[*particle as usize]).collect(),
        rested,
        strain_mean: strain(&sheet, &relaxed_m).0,
        from_drape_m,
        certificate: certify(&relaxed_m, &still, sheet.triangles(), Some(body), Bounds::default()),
    })
}
