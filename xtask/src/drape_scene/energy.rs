//! The energy that cloth holds where it lies: of its height, of stretched edges and of bent creases. Knows no motion and no contact.

use glam::DVec3;
use kitsuke_drape::links::{Crease, Link, creases, links, masses_kg};
use kitsuke_drape::sheet::Sheet;
use kitsuke_drape::woven::Woven;

const GRAVITY_M_PER_S2: f64 = 9.81;

/// What holds energy.
pub struct Stores {
    links: Vec<Link>,
    creases: Vec<Crease>,
    masses_kg: Vec<f64>,
}

/// Joules.
#[derive(Clone, Copy)]
pub struct Energy {
    /// Above the height 0.
    pub gravity_j: f64,
    pub stretch_j: f64,
    pub bending_j: f64,
}

impl Energy {
    pub fn sum_j(&self) -> f64 {
        self.gravity_j + self.stretch_j + self.bending_j
    }
}

pub fn stores(sheet: &Sheet, woven: &Woven) -> Stores {
    Stores { links: links(sheet, woven), creases: creases(sheet, woven), masses_kg: masses_kg(sheet, woven) }
}

pub fn energy(stores: &Stores, positions_m: &[DVec3]) -> Energy {
    let (mut gravity_j, mut stretch_j, mut bending_j) = (0.0, 0.0, 0.0);
    for (mass_kg, at_m) in stores.masses_kg.iter().zip(positions_m) {
        gravity_j += mass_kg * GRAVITY_M_PER_S2 * at_m.y;
    }
    for link in &stores.links {
        let [a, b] = link.ends.map(|end| positions_m[end as usize]);
        let longer_m = a.distance(b) - link.rest_m;
        stretch_j += 0.5 * longer_m * longer_m / link.compliance_m_per_n;
    }
    for crease in &stores.creases {
        let bent_m: DVec3 = (0..4).map(|i| positions_m[crease.corners[i] as usize] * crease.factors[i]).sum();
        bending_j += 0.5 * bent_m.length_squared() / crease.compliance_m_per_n;
    }
    Energy { gravity_j, stretch_j, bending_j }
}
