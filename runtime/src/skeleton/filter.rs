//! Smoothing of poses, bone by bone, in the space of rotations. No clock: the time since the pose before is an argument; what
//! is remembered stands in an explicit state, so that a motion filtered twice is the same twice.
//!
//! Both filters give nearly the same at any frame rate: what they remember is in seconds, not in frames. Their lag behind a
//! steady turn is documented with their parameters. Metres of the hips' way count as radians.

use super::tracked::{Tracked, nearest_to_rest};
use super::{Bone, Pose};
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// One-euro filter (Casiez, Roussel, Vogel 2012): a low pass that opens as the turn gets faster.
///
/// Behind a steady turn of ω rad/s it lags by 1 / (2π (`min_cutoff_hz` + `beta` ω)) seconds, less half a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneEuro {
    /// Cutoff at rest: lower is calmer. Above 0.
    pub min_cutoff_hz: f64,
    /// Cutoff added per speed, Hz per rad/s: higher follows closer.
    pub beta: f64,
    /// Cutoff of the speed itself. Above 0.
    pub speed_cutoff_hz: f64,
}

impl Default for OneEuro {
    /// 106 ms behind at rest, 16 ms behind an arm that turns at 240° per second.
    fn default() -> OneEuro {
        OneEuro { min_cutoff_hz: 1.5, beta: 2.0, speed_cutoff_hz: 1.0 }
    }
}

/// Holt's double exponential smoothing, as the Kinect applies it to positions (Microsoft, "Skeletal Joint Smoothing White
/// Paper"), here to rotations. Fractions are per 1/30 s.
///
/// It catches up with a steady turn and then runs ahead of it by `prediction_s`; until then, and in what is smaller than the
/// jitter radius, it lags, by `deviation_radius_rad` / ω seconds at most behind a turn of ω rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Holt {
    /// How much of the past stays after 1/30 s, from 0 to below 1.
    pub smoothing: f64,
    /// How fast the trend follows, above 0 to 1.
    pub correction: f64,
    /// How far the trend is carried on, seconds.
    pub prediction_s: f64,
    /// Differences from the expected below this are damped, radians.
    pub jitter_radius_rad: f64,
    /// The result stays this near to what was measured, radians.
    pub deviation_radius_rad: f64,
}

impl Default for Holt {
    /// The Kinect's values for calm hands, without prediction; radii for a forearm of 25 cm. When an arm begins to turn, it is at
    /// most 26 ms behind at 240° per second and 64 ms at 30° per second, then swings past by at most 7 ms and 33 ms.
    fn default() -> Holt {
        Holt { smoothing: 0.5, correction: 0.5, prediction_s: 0.0, jitter_radius_rad: 0.1, deviation_radius_rad: 0.16 }
    }
}

/// The time step of the Kinect's fractions.
const KINECT_FRAME_S: f64 = 1.0 / 30.0;

/// Which filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// See [`OneEuro`].
    OneEuro(OneEuro),
    /// See [`Holt`].
    Holt(Holt),
}

/// What a filter remembers of one motion.
#[derive(Clone, Debug, Default)]
pub struct FilterState {
    rotations: Vec<Track<DQuat>>,
    hips: Option<Track<DVec3>>,
}

/// What is remembered of one rotation or place.
#[derive(Clone, Copy, Debug)]
struct Track<T> {
    smooth: T,
    raw: T,
    /// Per second.
    trend: DVec3,
}

/// A space with differences.
trait Space: Copy {
    /// The way from `self` to `other`.
    fn to(self, other: Self) -> DVec3;
    /// This, moved so.
    fn by(self, way: DVec3) -> Self;
}

impl Space for DQuat {
    fn to(self, other: DQuat) -> DVec3 {
        let between = nearest_to_rest(self.inverse() * other);
        let (sin, axis) = (between.xyz().length(), between.xyz());
        // For small angles the vector part is half the way.
        if sin < 1e-12 { 2.0 * axis } else { axis * (2.0 * libm::atan2(sin, between.w) / sin) }
    }

    fn by(self, way: DVec3) -> DQuat {
        let angle = way.length();
        if angle < 1e-12 { self } else { (self * DQuat::from_axis_angle(way / angle, angle)).normalize() }
    }
}

impl Space for DVec3 {
    fn to(self, other: DVec3) -> DVec3 {
        other - self
    }

    fn by(self, way: DVec3) -> DVec3 {
        self + way
    }
}

impl Filter {
    /// The smoothed pose, `dt_s` seconds after the one before. The first pose, and one that follows at once or after more
    /// than a second, is taken as it is. Confidence passes through.
    #[must_use]
    pub fn apply(&self, state: &mut FilterState, tracked: &Tracked, dt_s: f64) -> Tracked {
        let tracked = Tracked { pose: tracked.pose.sanitised(), ..tracked.clone() };
        let hips_m = tracked.pose.hips_translation_m.as_dvec3();
        let rotation = |bone: Bone| tracked.pose.rotation(bone).as_dquat().normalize();
        let (Some(hips), true, true) = (&mut state.hips, !state.rotations.is_empty(), dt_s > 0.0 && dt_s <= 1.0) else {
            state.hips = Some(Track { smooth: hips_m, raw: hips_m, trend: DVec3::ZERO });
            let track = |bone| Track { smooth: rotation(bone), raw: rotation(bone), trend: DVec3::ZERO };
            state.rotations.clear();
            state.rotations.extend(Bone::ALL.map(track));
            return tracked;
        };
        let mut pose = Pose { hips_translation_m: self.step(hips, hips_m, dt_s).as_vec3(), ..Pose::REST };
        for (bone, track) in Bone::ALL.into_iter().zip(&mut state.rotations) {
            pose.rotations[bone as usize] = nearest_to_rest(self.step(track, rotation(bone), dt_s)).as_quat();
        }
        Tracked { pose, confidence: tracked.confidence }
    }

    fn step<T: Space>(&self, track: &mut Track<T>, raw: T, dt_s: f64) -> T {
        match self {
            Filter::OneEuro(filter) => filter.step(track, raw, dt_s),
            Filter::Holt(filter) => filter.step(track, raw, dt_s),
        }
    }
}

/// How much of a step a low pass takes in this time.
fn share(cutoff_hz: f64, dt_s: f64) -> f64 {
    1.0 - libm::exp(-TAU * cutoff_hz.max(1e-6) * dt_s)
}

impl OneEuro {
    fn step<T: Space>(&self, track: &mut Track<T>, raw: T, dt_s: f64) -> T {
        // The speed of what is measured: that of the smoothed rotation would depend on the frame rate.
        let speed = track.raw.to(raw) / dt_s;
        track.trend += share(self.speed_cutoff_hz, dt_s) * (speed - track.trend);
        let cutoff_hz = self.min_cutoff_hz + self.beta * track.trend.length();
        track.smooth = track.smooth.by(share(cutoff_hz, dt_s) * track.smooth.to(raw));
        track.raw = raw;
        track.smooth
    }
}

impl Holt {
    fn step<T: Space>(&self, track: &mut Track<T>, raw: T, dt_s: f64) -> T {
        let frames = dt_s / KINECT_FRAME_S;
        // What counts as jitter is the difference from what was expected: that from the frame before would grow with the
        // time between frames.
        let expected = track.smooth.by(track.trend * dt_s);
        let surprise = expected.to(raw);
        let damping = (surprise.length() / self.jitter_radius_rad.max(1e-9)).min(1.0);
        let taken = 1.0 - libm::pow(self.smoothing.clamp(0.0, 1.0), frames * damping);
        let smooth = expected.by(surprise * taken);
        let trend = track.smooth.to(smooth) / dt_s;
        let followed = 1.0 - libm::pow(1.0 - self.correction.clamp(0.0, 1.0), frames);
        track.trend += followed * (trend - track.trend);
        track.smooth = smooth;
        track.raw = raw;
        let ahead = smooth.by(track.trend * self.prediction_s);
        let off = raw.to(ahead);
        let most = self.deviation_radius_rad.max(0.0) / off.length().max(1e-12);
        if most < 1.0 { raw.by(off * most) } else { ahead }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILTERS: [Filter; 2] = [
        Filter::OneEuro(OneEuro { min_cutoff_hz: 1.5, beta: 2.0, speed_cutoff_hz: 1.0 }),
        Filter::Holt(Holt {
            smoothing: 0.5,
            correction: 0.5,
            prediction_s: 0.0,
            jitter_radius_rad: 0.1,
            deviation_radius_rad: 0.16,
        }),
    ];

    fn arm(angle_rad: f64) -> Tracked {
        let rotation = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle_rad).as_quat();
        Tracked::certain(Pose::REST.with(Bone::LeftUpperArm, rotation))
    }

    /// The filtered angles of a motion at a frame rate, and the time of each.
    fn filtered(filter: Filter, fps: f64, seconds: f64, angle_rad: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        let mut state = FilterState::default();
        let frames = 0..=(fps * seconds) as usize;
        let step = |frame| {
            let time_s = frame as f64 / fps;
            let smooth = filter.apply(&mut state, &arm(angle_rad(time_s)), if frame == 0 { 0.0 } else { 1.0 / fps });
            let rotation = smooth.pose.rotation(Bone::LeftUpperArm).as_dquat();
            (time_s, DQuat::IDENTITY.to(rotation).dot(DVec3::new(0.6, 0.0, 0.8)))
        };
        frames.map(step).collect()
    }

    #[test]
    fn stillness_stays_and_steps_arrive() {
        for filter in FILTERS {
            assert!(filtered(filter, 60.0, 1.0, |_| 0.7).iter().all(|(_, angle)| (angle - 0.7).abs() < 1e-6));
            let step = filtered(filter, 60.0, 3.0, |time_s| if time_s < 0.5 { 0.0 } else { 1.0 });
            assert!((step.last().unwrap().1 - 1.0).abs() < 0.01, "{filter:?}: {:?}", step.last());
        }
    }

    #[test]
    fn frame_rates_give_nearly_the_same() {
        let motion = |time_s: f64| libm::sin(2.0 * time_s) + 0.3 * libm::sin(7.0 * time_s);
        for filter in FILTERS {
            let fine = filtered(filter, 240.0, 4.0, motion);
            for fps in [30.0, 60.0, 120.0] {
                let coarse = filtered(filter, fps, 4.0, motion);
                let apart = coarse.iter().map(|&(time_s, angle)| {
                    let (_, same) = fine[(time_s * 240.0).round() as usize];
                    (angle - same).abs()
                });
                let most = apart.fold(0.0, f64::max);
                assert!(most < 2.6 / fps, "{filter:?} at {fps} fps: {most} rad apart");
            }
        }
    }

    /// The documented lag behind a steady turn, measured.
    #[test]
    fn lag_is_as_documented() {
        for (speed, fps) in [(0.5, 120.0), (2.0, 120.0), (4.0, 60.0)] {
            let turn = |time_s: f64| speed * time_s - 1.5;
            let lag_s = |filter| {
                let motion = filtered(filter, fps, 0.75, turn);
                let &(time_s, angle) = motion.last().unwrap();
                (turn(time_s) - angle) / speed
            };
            let expected_s = 1.0 / (TAU * (1.5 + 2.0 * speed)) - 0.5 / fps;
            let one_euro_s = lag_s(FILTERS[0]);
            assert!((one_euro_s - expected_s).abs() < 0.15 * expected_s + 1e-3, "{one_euro_s} instead of {expected_s}");
            assert!(lag_s(FILTERS[1]).abs() < 0.02, "Holt lags by {} s at {speed} rad/s", lag_s(FILTERS[1]));
        }
    }

    /// The same of Holt's filter, behind a turn that begins.
    #[test]
    fn holt_lags_as_documented() {
        for (speed, most_behind_s, most_ahead_s) in
            [(240.0_f64.to_radians(), 0.026, 0.007), (30.0_f64.to_radians(), 0.064, 0.033)]
        {
            let turn = |time_s: f64| speed * (time_s - 0.5).max(0.0);
            let (mut behind_s, mut ahead_s) = (0.0_f64, 0.0_f64);
            for fps in [30.0, 60.0, 120.0] {
                for (time_s, angle) in filtered(FILTERS[1], fps, 1.2, turn) {
                    let lag_s = (turn(time_s) - angle) / speed;
                    (behind_s, ahead_s) = (behind_s.max(lag_s), ahead_s.max(-lag_s));
                }
            }
            assert!((behind_s - most_behind_s).abs() < 1e-3, "{behind_s} s behind at {speed} rad/s");
            assert!((ahead_s - most_ahead_s).abs() < 1e-3, "{ahead_s} s ahead at {speed} rad/s");
        }
    }

    #[test]
    fn jitter_shrinks() {
        let mut seed = 1_u32;
        let noise: Vec<f64> = (0..400)
            .map(|_| {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(seed >> 8) / f64::from(1 << 24) - 0.5
            })
            .collect();
        let noisy = |time_s: f64| 0.04 * noise[(time_s * 30.0).round() as usize];
        let spread = |angles: &[f64]| (angles.iter().map(|a| a * a).sum::<f64>() / angles.len() as f64).sqrt();
        let raw: Vec<f64> = (0..=300).map(|frame| noisy(f64::from(frame) / 30.0)).collect();
        for filter in FILTERS {
            let smooth: Vec<f64> = filtered(filter, 30.0, 10.0, noisy).into_iter().map(|(_, angle)| angle).collect();
            assert!(spread(&smooth) < 0.6 * spread(&raw), "{filter:?}: {} of {}", spread(&smooth), spread(&raw));
        }
    }

    #[test]
    fn nothing_becomes_not_a_number() {
        for filter in FILTERS {
            let mut state = FilterState::default();
            let broken = Pose::REST.with(Bone::Head, glam::Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0));
            for dt_s in [0.0, 1e-9, 0.01, f64::NAN, -1.0, 1e9, 0.02] {
                for pose in [&broken, &Pose::REST, &arm(std::f64::consts::PI).pose] {
                    assert!(filter.apply(&mut state, &Tracked::certain(pose.clone()), dt_s).pose.is_valid());
                }
            }
        }
    }
}
