//! The forces of P2, each a plain function of numbers and places. Knows no sheet, no body and no steps.

use glam::DVec3;

/// Standard gravity, m/s².
pub const GRAVITY_M_PER_S2: f64 = 9.806_65;

/// Force of an edge of the given length, newtons; positive draws its ends together. Quadratic in how much longer or shorter it
/// is than at rest, with a coefficient of its own on either side, both in N/m² (P2, section 2.2 (a), figure 4).
///
/// The slope at rest is 0: where the load is small, cloth stays a little stretched, which stands for hysteresis (section 2.3).
#[must_use]
pub fn tension_n(extension_n_per_m2: f64, compression_n_per_m2: f64, rest_m: f64, length_m: f64) -> f64 {
    let longer_m = length_m - rest_m;
    if longer_m >= 0.0 { extension_n_per_m2 * longer_m * longer_m } else { -compression_n_per_m2 * longer_m * longer_m }
}

/// The force on the first end of an edge, newtons; the second end gets the opposite. Ends at one place have no direction: 0.
#[must_use]
pub fn tension_on_first_n(
    extension_n_per_m2: f64,
    compression_n_per_m2: f64,
    rest_m: f64,
    ends_m: [DVec3; 2],
) -> DVec3 {
    let along_m = ends_m[1] - ends_m[0];
    let length_m = along_m.length_squared().sqrt();
    if length_m == 0.0 {
        return DVec3::ZERO;
    }
    along_m * (tension_n(extension_n_per_m2, compression_n_per_m2, rest_m, length_m) / length_m)
}

/// The constant of a direction between warp, weft and bias. `grain` is the cosine of twice the angle from the warp: 1 is warp,
/// -1 is weft, 0 is bias. P2 leaves open what lies between (it names fibre directions as future work): here the square of the
/// grain, so that the constant is smooth and each of the three directions has exactly its own.
#[must_use]
pub fn along_grain(warp: f64, weft: f64, bias: f64, grain: f64) -> f64 {
    bias + (if grain >= 0.0 { warp } else { weft } - bias) * grain * grain
}

/// Torque that opens a crease, N·m, never positive: `c (cos θ - 1)`, θ between the normals of both triangles, largest at
/// 180° (P2, eq. 1).
#[must_use]
pub fn bending_torque_nm(c_nm: f64, cos_theta: f64) -> f64 {
    c_nm * (cos_theta - 1.0)
}

/// Forces of a crease on both ends of the shared edge and on both outer vertices, in this order, newtons. Outer vertices get
/// `c (cos θ - 1) / d` along their triangle's normal, `d` their distance from the edge (P2, eq. 2 and 3), toward flat.
///
/// P2 says nothing of the edge; it takes the opposite forces here, divided where the outer vertices stand over it, so that
/// neither forces nor torques of a crease add up to anything and cloth does not carry itself away. A triangle without area: no forces.
#[must_use]
pub fn bending_n(c_nm: f64, edge_m: [DVec3; 2], outer_m: [DVec3; 2]) -> [DVec3; 4] {
    let along_m = edge_m[1] - edge_m[0];
    let to_outer_m = [outer_m[0] - edge_m[0], outer_m[1] - edge_m[0]];
    let area_vectors = [along_m.cross(to_outer_m[0]), to_outer_m[1].cross(along_m)];
    // Of doubled areas, squared.
    let squares = area_vectors.map(DVec3::length_squared);
    let product = squares[0] * squares[1];
    if product == 0.0 {
        return [DVec3::ZERO; 4];
    }
    let torque_nm = bending_torque_nm(c_nm, area_vectors[0].dot(area_vectors[1]) / product.sqrt());
    // Folded to the side to which the normals point, the outer vertices are pushed back against the normals.
    let toward_flat = if area_vectors[0].dot(to_outer_m[1]) >= 0.0 { 1.0 } else { -1.0 };
    let length_squared = along_m.length_squared();
    let signed = toward_flat * torque_nm * length_squared.sqrt();
    let per_length_squared = 1.0 / length_squared;
    let mut forces = [DVec3::ZERO; 4];
    for side in 0..2 {
        // The normal is vector over doubled area, d is doubled area over length: together one division.
        let force = area_vectors[side] * (signed / squares[side]);
        let share = to_outer_m[side].dot(along_m) * per_length_squared;
        forces[0] -= force * (1.0 - share);
        forces[1] -= force * share;
        forces[2 + side] = force;
    }
    forces
}

/// Weight of one particle, newtons: that of the whole cloth over the number of particles (P2, section 3).
#[must_use]
pub fn particle_weight_n(mass_kg_per_m2: f64, area_m2: f64, particles: usize) -> f64 {
    mass_kg_per_m2 * area_m2 * GRAVITY_M_PER_S2 / particles as f64
}

/// A force above the limit becomes one of the size `instead_n` with the same direction (P2, section 4).
#[must_use]
pub fn limited_n(force_n: DVec3, limit_n: f64, instead_n: f64) -> DVec3 {
    let squared = force_n.length_squared();
    if squared <= limit_n * limit_n { force_n } else { force_n * (instead_n / squared.sqrt()) }
}

/// What friction leaves of a slide along a contact, metres: Coulomb's law with displacements for forces, as in all of P2.
/// Where the slide is at most `friction` times the push, it is held altogether.
#[must_use]
pub fn after_friction_m(slide_m: DVec3, push_m: f64, friction: f64) -> DVec3 {
    let length_m = slide_m.length_squared().sqrt();
    let held_m = friction * push_m;
    if length_m <= held_m { DVec3::ZERO } else { slide_m * (1.0 - held_m / length_m) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12 * (1.0 + a.abs().max(b.abs()))
    }

    #[test]
    fn tension_is_quadratic_and_weaker_in_compression() {
        // 100 N/m² for 0.2 m and 25 N/m² for 0.2 m.
        assert!(near(tension_n(100.0, 25.0, 1.0, 1.2), 4.0));
        assert!(near(tension_n(100.0, 25.0, 1.0, 0.8), -1.0));
        assert!(near(tension_n(100.0, 25.0, 1.0, 1.4) / tension_n(100.0, 25.0, 1.0, 1.2), 4.0));
        let force = tension_on_first_n(100.0, 25.0, 1.0, [DVec3::ZERO, DVec3::new(0.0, 1.2, 0.0)]);
        assert!((force - DVec3::new(0.0, 4.0, 0.0)).length() < 1e-12);
        let force = tension_on_first_n(100.0, 25.0, 1.0, [DVec3::ZERO, DVec3::new(0.0, 0.8, 0.0)]);
        assert!((force - DVec3::new(0.0, -1.0, 0.0)).length() < 1e-12);
    }

    /// P2, section 2.3.
    #[test]
    fn tension_has_no_slope_at_rest() {
        let slope = |at: f64| (tension_n(100.0, 25.0, 1.0, at + 1e-6) - tension_n(100.0, 25.0, 1.0, at - 1e-6)) / 2e-6;
        assert!(slope(1.0).abs() < 1e-4, "{}", slope(1.0));
        assert!((slope(1.1) - 20.0).abs() < 1e-6, "{}", slope(1.1));
        assert!((slope(0.9) - 5.0).abs() < 1e-6, "{}", slope(0.9));
    }

    /// P2, section 2.3: drawn back by its own force alone, cloth that was stretched a little stays so, where a linear spring of
    /// equal force at the start has long gone back.
    #[test]
    fn cloth_stays_a_little_stretched() {
        let (mut quadratic_m, mut linear_m) = (1.01, 1.01);
        for _ in 0..1000 {
            quadratic_m -= tension_n(1.0, 0.3, 1.0, quadratic_m);
            linear_m -= 0.01 * (linear_m - 1.0);
        }
        // The quadratic law's stretch decays as 1 / (100 + steps).
        assert!((quadratic_m - 1.0 - 1.0 / 1100.0).abs() < 1e-5, "{quadratic_m}");
        assert!(linear_m - 1.0 < 1e-6, "{linear_m}");
    }

    /// The force is the downhill slope of the energy k (r - L)³ / 3 in every direction.
    #[test]
    fn tension_is_the_derivative_of_its_energy() {
        let other = DVec3::new(0.3, -0.2, 0.9);
        let energy = |at: DVec3| {
            let longer = (other - at).length() - 0.7;
            if longer >= 0.0 { 100.0 * longer.powi(3) / 3.0 } else { -25.0 * longer.powi(3) / 3.0 }
        };
        for at in [DVec3::new(0.1, 0.2, 0.05), DVec3::new(0.2, 0.0, 0.7)] {
            let force = tension_on_first_n(100.0, 25.0, 0.7, [at, other]);
            for axis in DVec3::AXES {
                let slope = (energy(at + axis * 1e-6) - energy(at - axis * 1e-6)) / 2e-6;
                assert!((force.dot(axis) + slope).abs() < 1e-6, "{force} {slope}");
            }
        }
    }

    #[test]
    fn each_grain_direction_has_its_own_constant() {
        let at_degrees = |degrees: f64| along_grain(30.0, 20.0, 1.0, libm::cos(2.0 * degrees.to_radians()));
        assert!(near(at_degrees(0.0), 30.0) && near(at_degrees(90.0), 20.0) && near(at_degrees(180.0), 30.0));
        assert!((at_degrees(45.0) - 1.0).abs() < 1e-12);
        assert!(near(at_degrees(30.0), 1.0 + 29.0 / 4.0) && near(at_degrees(60.0), 1.0 + 19.0 / 4.0));
    }

    /// A crease along Z, its left triangle in the plane y = 0, its right one lifted by `theta_rad`.
    fn crease(theta_rad: f64) -> [DVec3; 4] {
        let lifted = DVec3::new(libm::cos(theta_rad), libm::sin(theta_rad), 0.0);
        [DVec3::ZERO, DVec3::Z, DVec3::new(-0.1, 0.0, 0.4), lifted * 0.2 + DVec3::Z * 0.7]
    }

    #[test]
    fn bending_is_equation_3_on_the_outer_vertices() {
        for degrees in [1.0f64, 30.0, 90.0, 150.0, 179.0, -1.0, -90.0, -170.0] {
            let theta_rad = degrees.to_radians();
            let [a, b, left, right] = crease(theta_rad);
            let forces = bending_n(0.01, [a, b], [left, right]);
            // By hand: 0.01 (1 - cos θ) over 0.1 m and 0.2 m.
            let opened = 0.01 * (1.0 - libm::cos(theta_rad));
            assert!(near(forces[2].length(), opened / 0.1), "{degrees}: {}", forces[2].length());
            assert!(near(forces[3].length(), opened / 0.2), "{degrees}: {}", forces[3].length());
            // Across the triangles, toward flat: the lifted one goes down, the flat one too; both up if it hangs.
            let turned = DVec3::new(-libm::sin(theta_rad), libm::cos(theta_rad), 0.0);
            assert!(near(forces[3].dot(turned), -degrees.signum() * opened / 0.2), "{degrees}: {}", forces[3]);
            assert!(near(forces[2].y, -degrees.signum() * opened / 0.1), "{degrees}: {}", forces[2]);
        }
        assert!(near(bending_torque_nm(0.01, -1.0), -0.02));
        assert!(bending_torque_nm(0.01, 1.0) == 0.0);
    }

    #[test]
    fn a_crease_moves_and_turns_nothing_as_a_whole() {
        let places = crease(1.1);
        let forces = bending_n(0.01, [places[0], places[1]], [places[2], places[3]]);
        let sum: DVec3 = forces.iter().sum();
        let torque: DVec3 = places.iter().zip(forces).map(|(place, force)| place.cross(force)).sum();
        assert!(forces[0].length() > 1e-3 && sum.length() < 1e-15 && torque.length() < 1e-15, "{sum} {torque}");
        assert_eq!(bending_n(0.01, [DVec3::ZERO, DVec3::Z], [DVec3::Z * 0.5, DVec3::X]), [DVec3::ZERO; 4]);
    }

    #[test]
    fn weight_is_divided_evenly_and_forces_are_limited() {
        assert!(near(particle_weight_n(0.2, 3.0, 6), 0.980_665));
        let force = DVec3::new(0.0, 3.0, 4.0);
        assert_eq!(limited_n(force, 5.0, 1.0), force);
        assert!((limited_n(force, 4.9, 1.5) - DVec3::new(0.0, 0.9, 1.2)).length() < 1e-15);
    }

    #[test]
    fn friction_holds_up_to_its_cone() {
        let slide = DVec3::new(0.3, 0.0, 0.4);
        assert_eq!(after_friction_m(slide, 1.0, 0.51), DVec3::ZERO);
        assert!((after_friction_m(slide, 0.5, 0.5) - slide * 0.5).length() < 1e-15);
        assert_eq!(after_friction_m(slide, 0.0, 0.5), slide);
    }
}
