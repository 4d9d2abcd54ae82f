//! How wrong a registered shape is: distances in figures, and the error against the right shape. Knows nobody who registered it.

use glam::DVec3;
use kitsuke_pipeline::source::import;
use kitsuke_pipeline::stages::register::Rigid;
use std::path::Path;

/// The distance that this share of all does not exceed, millimetres.
pub fn at_mm(distances_m: &[f64], share: f64) -> f64 {
    let mut sorted = distances_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(((sorted.len().max(1) - 1) as f64 * share).round() as usize).map_or(0.0, |d| d * 1e3)
}

/// Their mean, millimetres.
pub fn mean_mm(distances_m: &[f64]) -> f64 {
    let mut sorted = distances_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.iter().sum::<f64>() / sorted.len().max(1) as f64 * 1e3
}

/// Mean, median, 80 %, 95 % and largest, millimetres.
pub fn spread(distances_m: &[f64]) -> String {
    let at = |share| at_mm(distances_m, share);
    format!("{:>8.2}{:>8.2}{:>8.2}{:>8.2}{:>8.2}", mean_mm(distances_m), at(0.5), at(0.8), at(0.95), at(1.0))
}

/// The right shape: as many vertices as the base has.
pub fn read_truth(path: &Path, count: usize) -> Result<Vec<DVec3>, String> {
    let mesh = import::read(&path.to_string_lossy(), path, &mut Vec::new()).map_err(|error| error.to_string())?;
    let mesh = mesh.ok_or_else(|| format!("{} cannot be read", path.display()))?;
    if mesh.positions.len() != count {
        return Err(format!("{} has {} vertices, the base {count}", path.display(), mesh.positions.len()));
    }
    Ok(mesh.positions)
}

/// A registered shape held against the right one, after the best rigid motion.
pub struct Against {
    /// How far each vertex lies from its right place, metres.
    pub laid_m: Vec<f64>,
    /// The same of the base as it was.
    pub base_m: Vec<f64>,
    /// Triangles that are turned against the base and are not in the right shape.
    pub turned: usize,
}

impl Against {
    /// Compares.
    pub fn truth(laid: &[DVec3], base: &[DVec3], triangles: &[[u32; 3]], truth: &[DVec3]) -> Against {
        let weights = vec![1.0; laid.len()];
        let moved = |from: &[DVec3]| -> Vec<DVec3> {
            let motion = Rigid::between(from, truth, &weights);
            from.iter().map(|&p| motion.place(p)).collect()
        };
        let (laid, base) = (moved(laid), moved(base));
        let normal = |places: &[DVec3], t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| places[v as usize]);
            (b - a).cross(c - a)
        };
        let turned = |t: &&[u32; 3]| {
            normal(&laid, t).dot(normal(&base, t)) < 0.0 && normal(truth, t).dot(normal(&base, t)) >= 0.0
        };
        let away = |places: &[DVec3]| -> Vec<f64> { places.iter().zip(truth).map(|(a, b)| a.distance(*b)).collect() };
        Against { turned: triangles.iter().filter(turned).count(), laid_m: away(&laid), base_m: away(&base) }
    }

    /// In words.
    pub fn text(&self) -> String {
        format!(
            "from the right shape{}\nthe base would be   {}\n{} triangles are turned against the base and are not in the right shape",
            spread(&self.laid_m),
            spread(&self.base_m),
            self.turned
        )
    }
}
