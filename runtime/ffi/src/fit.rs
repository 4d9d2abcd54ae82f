//! Fits to wearers.

use crate::buffer::{self, given, given_mut, put_handle, put_struct, slice, write_text};
use crate::pack::{Kimono, KitsukePack};
use crate::pose::out_of_range;
use crate::status::{Status, guarded, set_message};
use bytemuck::{Pod, Zeroable};
use kitsuke::accessories::Accessories;
use kitsuke::fit::{self, Fit, Scratch, Tailor, Verdict};
use kitsuke::measurement::{Measurement, Measurements};
use std::sync::Arc;

/// What fits one kimono to wearers, with the working memory of one thread and its last fit.
pub struct KitsukeFitter {
    kimono: Arc<Kimono>,
    tailor: Tailor,
    scratch: Scratch,
    last: Option<Fit>,
}

/// What became of a fit.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VerdictKind {
    /// Every dimension is as wanted.
    Reachable = 0,
    /// Every dimension is as wanted, in a shape that no size vouches for.
    Strayed = 1,
    /// A size was made for such a body and is worn as it is.
    SizeDiffers = 2,
    /// Some dimension cannot be reached.
    OutOfReach = 3,
}

/// What a fit says as a whole.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FitInfo {
    /// To be set by the caller: `sizeof` of this struct.
    pub struct_size: u32,
    /// A [`VerdictKind`].
    pub verdict: i32,
    /// How far the cloth is from what wearers of the nearest sizes have, root mean square, metres.
    pub moved_m: f32,
    /// How little the sizes' bodies say of this wearer: 0 for one of them, 1 far from all.
    pub novelty: f32,
}

/// What became of a dimension, metres along the surface.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Reach {
    /// To be set by the caller: `sizeof` of this struct.
    pub struct_size: u32,
    /// By the rules.
    pub wanted_m: f32,
    /// On the fitted kimono.
    pub reached_m: f32,
    /// The shortest that the sizes can give.
    pub lowest_m: f32,
    /// The longest.
    pub highest_m: f32,
}

/// How many measurements of bodies there are.
#[unsafe(no_mangle)]
pub extern "C" fn kitsuke_measurement_count() -> u32 {
    Measurement::COUNT as u32
}

/// Copies a measurement's name, for example `bust_girth`, as [`kitsuke_message`](crate::kitsuke_message) does; returns its length, 0
/// when there is no such measurement.
///
/// # Safety
/// `buffer` must be null or have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_measurement_name(measurement: u32, buffer: *mut u8, capacity: usize) -> usize {
    let name = Measurement::ALL.get(measurement as usize).map_or("", |measurement| measurement.name());
    // SAFETY: as the caller promises.
    unsafe { write_text(name, buffer, capacity) }
}

/// The number of a measurement by its name, or -1.
///
/// # Safety
/// `name` must point to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_measurement_from_name(name: *const u8, length: usize) -> i32 {
    // SAFETY: as the caller promises.
    let name = unsafe { slice("the name", name, length) }.unwrap_or_default();
    let found = Measurement::ALL.iter().position(|measurement| measurement.name().as_bytes() == name);
    found.map_or(-1, |number| number as i32)
}

/// Makes a fitter; [`Status::Fit`] when the kimono has no sizes. Takes a fraction of a second.
///
/// # Safety
/// `pack` must be null or a handle, `fitter` a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_new(pack: *const KitsukePack, fitter: *mut *mut KitsukeFitter) -> Status {
    guarded(|| {
        let make = || {
            // SAFETY: as the caller promises.
            let kimono = unsafe { given("the pack", pack)?.0.clone() };
            let Kimono::Pack(pack) = &*kimono else {
                return Err((Status::Fit, "a fitted kimono has no sizes; fit the one of the pack".to_owned()));
            };
            let data = pack.fit_data().map_err(|error| (Status::Pack, error.to_string()))?;
            let data = data.ok_or_else(|| (Status::Fit, "the kimono has no sizes".to_owned()))?;
            let tailor = Tailor::new(pack.garment(), data).map_err(|error| (Status::Fit, error.to_string()))?;
            Ok(KitsukeFitter { kimono, tailor, scratch: Scratch::default(), last: None })
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the fitter", fitter, make) }
    })
}

/// Frees a fitter.
///
/// # Safety
/// `fitter` must be null or a handle that has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_free(fitter: *mut KitsukeFitter) {
    // SAFETY: as the caller promises.
    unsafe { buffer::free(fitter) };
}

/// How many rule sets the kimono can be ordered by; the first is its own.
///
/// # Safety
/// `fitter` must be null or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_rule_set_count(fitter: *const KitsukeFitter) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { fitter.as_ref() }.map_or(0, |fitter| fitter.tailor.fitter().data().rules.len() as u32)
}

/// How many dimensions a fit has.
///
/// # Safety
/// `fitter` must be null or a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_dimension_count(fitter: *const KitsukeFitter) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { fitter.as_ref() }.map_or(0, |fitter| fitter.tailor.fitter().data().dimensions.len() as u32)
}

/// Copies the name of a rule set (`dimension` 0) or of a dimension (`dimension` 1) as [`kitsuke_message`](crate::kitsuke_message) does;
/// returns its whole length, 0 when there is none.
///
/// # Safety
/// `fitter` must be null or a handle, `buffer` null or have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_text(
    fitter: *const KitsukeFitter,
    dimension: u32,
    index: u32,
    buffer: *mut u8,
    capacity: usize,
) -> usize {
    // SAFETY: as the caller promises.
    let data = unsafe { fitter.as_ref() }.map(|fitter| fitter.tailor.fitter().data());
    let name = data.and_then(|data| match dimension {
        0 => data.rules.get(index as usize).map(|rules| rules.name.as_str()),
        _ => data.dimensions.get(index as usize).map(|dimension| dimension.name.as_str()),
    });
    // SAFETY: as the caller promises.
    unsafe { write_text(name.unwrap_or(""), buffer, capacity) }
}

/// Fits the kimono to a wearer: `measurements_m` has a number per measurement, metres, NaN where it is not known; `rules` counts rule
/// sets from 0. `info`, if not null, gets the verdict, and [`kitsuke_message`](crate::kitsuke_message) then says it in words. `fitted`, if
/// not null, gets a kimono of its own, which is posed and drawn as any other; without it a fit takes a fraction of a millisecond.
///
/// # Safety
/// `fitter` must be null or a handle that no other thread uses, `measurements_m` point to `count` numbers, `info` be null or a struct of
/// as many bytes as its first field says, `fitted` null or a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fit(
    fitter: *mut KitsukeFitter,
    measurements_m: *const f32,
    count: usize,
    rules: u32,
    info: *mut FitInfo,
    fitted: *mut *mut KitsukePack,
) -> Status {
    let mut said = String::new();
    let status = guarded(|| {
        // SAFETY: as the caller promises.
        let (fitter, known) =
            unsafe { (given_mut("the fitter", fitter)?, slice("the measurements", measurements_m, count)?) };
        if known.len() > Measurement::COUNT {
            return Err((Status::Range, format!("there are {} measurements, not {}", Measurement::COUNT, known.len())));
        }
        let known = Measurement::ALL.into_iter().zip(known).filter(|(_, value_m)| !value_m.is_nan());
        let wearer = known.fold(Measurements::default(), |all, (measurement, &value_m)| all.with(measurement, value_m));
        let KitsukeFitter { kimono, tailor, scratch, last } = fitter;
        let fails = |error: &dyn std::fmt::Display| (Status::Fit, error.to_string());
        let fit = tailor.fitter().fit(&wearer, rules as usize, scratch).map_err(|error| fails(&error))?;
        said = tailor.fitter().explain(&fit, &wearer);
        let verdict = match fit.verdict {
            Verdict::Reachable => VerdictKind::Reachable,
            Verdict::Strayed => VerdictKind::Strayed,
            Verdict::SizeDiffers { .. } => VerdictKind::SizeDiffers,
            Verdict::OutOfReach { .. } => VerdictKind::OutOfReach,
        };
        if !info.is_null() {
            let found = FitInfo { struct_size: 0, verdict: verdict as i32, moved_m: fit.moved_m, novelty: fit.novelty };
            // SAFETY: as the caller promises.
            unsafe { put_struct("info", info, &found) }?;
        }
        let fit = &*last.insert(fit);
        if fitted.is_null() {
            return Ok(());
        }
        let make = || {
            let base = kimono.garment();
            let garment = tailor.made(base, fit).map_err(|error| fails(&error))?;
            let [base_m, fitted_m] = [base, &garment].map(|garment| &garment.data().mesh.positions_m);
            let own = kimono.accessories();
            let obi = own.obi.as_ref().map(|obi| obi.fitted(base_m, fitted_m));
            let accessories = Box::new(Accessories { obi, ..own.clone() });
            Ok(KitsukePack(Arc::new(Kimono::Fitted { garment: Box::new(garment), accessories })))
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the fitted kimono", fitted, make) }
    });
    if status == Status::Ok {
        set_message(said);
    }
    status
}

/// What became of a dimension in the last fit; [`Status::Fit`] before the first.
///
/// # Safety
/// `fitter` must be null or a handle, `reach` null or a struct of as many bytes as its first field says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_fitter_reach(
    fitter: *const KitsukeFitter,
    dimension: u32,
    reach: *mut Reach,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let fitter = unsafe { given("the fitter", fitter)? };
        let fit = fitter.last.as_ref().ok_or_else(|| (Status::Fit, "nobody was fitted yet".to_owned()))?;
        let (dimension, count) = (dimension as usize, fit.dimensions.len());
        let found = fit.dimensions.get(dimension).ok_or_else(|| out_of_range("dimension", dimension, count))?;
        let &fit::Reach { wanted_m, reached_m, lowest_m, highest_m } = found;
        let found = Reach { struct_size: 0, wanted_m, reached_m, lowest_m, highest_m };
        // SAFETY: as the caller promises.
        unsafe { put_struct("the reach", reach, &found) }
    })
}
