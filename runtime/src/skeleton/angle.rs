//! How far two rotations lie apart.

use glam::Quat;

/// The angle of the rotation that leads from one rotation to the other, 0 to pi, whatever the quaternions' signs and
/// lengths. An arc cosine of the dot product would lose half the digits near 0.
#[must_use]
pub fn angle_between_rad(a: Quat, b: Quat) -> f32 {
    let between = a.conjugate() * b;
    2.0 * libm::atan2f(between.xyz().length(), between.w.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn angles_are_exact_at_both_ends_and_blind_to_sign_and_length() {
        let axis = Vec3::new(0.6, 0.0, 0.8);
        for angle in [0.0_f32, 1e-6, 1e-4, 0.3, 1.5, 3.0, std::f32::consts::PI] {
            let turned = Quat::from_axis_angle(axis, angle);
            for other in [turned, -turned, turned * 3.0] {
                let found = angle_between_rad(Quat::IDENTITY, other);
                assert!((found - angle).abs() <= 1e-6, "{found} for {angle}");
            }
        }
        assert!(angle_between_rad(Quat::IDENTITY, Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)).is_nan());
    }
}
