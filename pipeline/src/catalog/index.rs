//! `catalog/index.toml`: what each pack holds and how far it lies from the artist's files, as text that stays the same
//! when nothing changed.

use super::CatalogError;
use crate::build::Built;
use crate::look::frames::Distance;
use crate::measure::audit::deepest;
use crate::source::is_garment_id;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// What the index says of one pack. Lengths are millimetres rounded to a micrometre.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// blake3 of the pack, hexadecimal.
    pub blake3: String,
    /// Length of the pack.
    pub bytes: u64,
    /// How much of that the targets take.
    pub target_bytes: u64,
    /// Vertices, seam twins included.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Drivers.
    pub drivers: u64,
    /// Largest error of any target.
    pub max_mm: f64,
    /// Mean error over all targets.
    pub mean_mm: f64,
    /// How far any mix of sizes lies from what it would be without steps, where there are sizes.
    pub mixed_max_mm: Option<f64>,
    /// Fastest movement between the samples, mm per degree.
    pub speed_mm_per_deg: f64,
    /// The joint and the two nearest poses of that.
    pub fastest: [String; 3],
    /// Farthest that any vertex moves per 0.01 degrees.
    pub step_mm: f64,
    /// Farthest that this movement changes from one step to the next.
    pub step_change_mm: f64,
    /// The two poses that are hardest to tell apart.
    pub nearest: [String; 2],
    /// Degrees between them.
    pub nearest_deg: f64,
    /// Of the audit's poses how many were taken, how many have cloth deeper than 2 mm and than 5 mm in the body.
    pub inside_poses: [u64; 3],
    /// How deep the deepest lies.
    pub inside_max_mm: f64,
    /// Errors target by target.
    pub targets: Vec<TargetEntry>,
}

/// What the index says of one target.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetEntry {
    /// The target's name.
    pub name: String,
    /// Largest distance from its file when it is blended alone.
    pub max_mm: f64,
    /// Mean of those distances.
    pub mean_mm: f64,
    /// Largest distance from its file in its pose with the garment's own kernel.
    pub blended_max_mm: f64,
    /// Largest distance from its file in its pose with the paper's kernel.
    pub paper_max_mm: f64,
    /// Mean of those distances.
    pub paper_mean_mm: f64,
    /// Mean, 99th percentile and largest distance from what the other targets predict.
    pub left_out_mm: [f64; 3],
}

/// The whole index by garment.
pub type Index = BTreeMap<String, Entry>;

impl Entry {
    /// The entry of a garment just built, of whose pack the targets take `target_bytes`.
    #[must_use]
    pub fn new(built: &Built, target_bytes: u64) -> Entry {
        let mut targets: Vec<TargetEntry> = built
            .quality
            .iter()
            .map(|quality| {
                let Distance { max_m, mean_m, .. } = quality.alone;
                let (max_mm, mean_mm) = (rounded_mm(max_m), rounded_mm(mean_m));
                let blended_max_mm = rounded_mm(quality.blended.max_m);
                let Distance { max_m, mean_m, .. } = quality.paper;
                let (paper_max_mm, paper_mean_mm) = (rounded_mm(max_m), rounded_mm(mean_m));
                let name = quality.name.clone();
                let left_out_mm = [0.0; 3];
                TargetEntry { name, max_mm, mean_mm, blended_max_mm, paper_max_mm, paper_mean_mm, left_out_mm }
            })
            .collect();
        let data = built.garment.data();
        let certificate = data.certificate.as_ref().expect("a built garment has a certificate");
        for (target, error) in targets.iter_mut().zip(&certificate.left_out) {
            target.left_out_mm = [error.mean_mm, error.p99_mm, error.max_mm].map(rounded);
        }
        let row = |row: u16| match usize::from(row).checked_sub(1) {
            Some(target) => data.targets[target].name.clone(),
            None => "base".to_owned(),
        };
        let [first, second] = certificate.fastest_rows.map(row);
        let deeper = |least_m: f32| built.inside.iter().filter(|depth| depth.depth_m > least_m).count() as u64;
        let means_m = built.quality.iter().map(|quality| quality.alone.mean_m);
        Entry {
            blake3: blake3::hash(&built.pack).to_hex().to_string(),
            bytes: built.pack.len() as u64,
            target_bytes,
            vertices: built.garment.vertex_count() as u64,
            triangles: built.garment.triangle_count() as u64,
            drivers: built.garment.data().drivers.len() as u64,
            max_mm: targets.iter().map(|target| target.max_mm).fold(0.0, f64::max),
            mean_mm: rounded_mm(means_m.sum::<f32>() / targets.len().max(1) as f32),
            mixed_max_mm: built.mixed.map(|lost| rounded_mm(lost.max_m)),
            speed_mm_per_deg: rounded(certificate.speed_mm_per_deg),
            fastest: [certificate.fastest_joint.name().to_owned(), first, second],
            step_mm: rounded(certificate.step_mm),
            step_change_mm: rounded(certificate.step_change_mm),
            nearest: certificate.nearest.rows.map(row),
            nearest_deg: rounded(certificate.nearest.apart_deg),
            inside_poses: [built.inside.len() as u64, deeper(0.002), deeper(0.005)],
            inside_max_mm: rounded_mm(deepest(&built.inside).depth_m),
            targets,
        }
    }

    /// The entry as it stands in the file.
    #[must_use]
    pub fn to_text(&self) -> String {
        let Entry { blake3, bytes, target_bytes, vertices, triangles, drivers, max_mm, mean_mm, targets, .. } = self;
        let Entry { speed_mm_per_deg, fastest, step_mm, step_change_mm, nearest, nearest_deg, .. } = self;
        let ([inside, inside_2, inside_5], inside_max_mm) = (self.inside_poses, self.inside_max_mm);
        let mut text = format!(
            "blake3 = \"{blake3}\"\nbytes = {bytes}\ntarget_bytes = {target_bytes}\nvertices = {vertices}\n\
             triangles = {triangles}\ndrivers = {drivers}\nmax_mm = {max_mm:.3}\nmean_mm = {mean_mm:.3}\n"
        );
        if let Some(mixed_max_mm) = self.mixed_max_mm {
            let _ = writeln!(text, "mixed_max_mm = {mixed_max_mm:.3}");
        }
        let _ = write!(
            text,
            "speed_mm_per_deg = {speed_mm_per_deg:.3}\nfastest = {}\nstep_mm = {step_mm:.3}\n\
             step_change_mm = {step_change_mm:.3}\nnearest = {}\nnearest_deg = {nearest_deg:.3}\n\
             inside_poses = [{inside}, {inside_2}, {inside_5}]\ninside_max_mm = {inside_max_mm:.3}\ntargets = [\n",
            toml::Value::from(fastest.to_vec()),
            toml::Value::from(nearest.to_vec())
        );
        for target in targets {
            let TargetEntry { name, max_mm, mean_mm, blended_max_mm, paper_max_mm, paper_mean_mm, left_out_mm } =
                target;
            let [left_out_mean, left_out_p99, left_out_max] = left_out_mm;
            let name = toml::Value::from(name.as_str());
            let _ = writeln!(
                text,
                "    {{ name = {name}, max_mm = {max_mm:.3}, mean_mm = {mean_mm:.3}, \
                 blended_max_mm = {blended_max_mm:.3}, paper_max_mm = {paper_max_mm:.3}, \
                 paper_mean_mm = {paper_mean_mm:.3}, \
                 left_out_mm = [{left_out_mean:.3}, {left_out_p99:.3}, {left_out_max:.3}] }},"
            );
        }
        text + "]\n"
    }

    fn from_table(table: &toml::Table) -> Option<Entry> {
        let whole = |key: &str| table.get(key)?.as_integer().and_then(|number| u64::try_from(number).ok());
        let target = |value: &toml::Value| {
            let table = value.as_table()?;
            Some(TargetEntry {
                name: table.get("name")?.as_str()?.to_owned(),
                max_mm: table.get("max_mm")?.as_float()?,
                mean_mm: table.get("mean_mm")?.as_float()?,
                paper_max_mm: table.get("paper_max_mm")?.as_float()?,
                blended_max_mm: table.get("blended_max_mm")?.as_float()?,
                paper_mean_mm: table.get("paper_mean_mm")?.as_float()?,
                left_out_mm: array(table, "left_out_mm", toml::Value::as_float)?,
            })
        };
        Some(Entry {
            blake3: table.get("blake3")?.as_str()?.to_owned(),
            bytes: whole("bytes")?,
            target_bytes: whole("target_bytes")?,
            vertices: whole("vertices")?,
            triangles: whole("triangles")?,
            drivers: whole("drivers")?,
            max_mm: table.get("max_mm")?.as_float()?,
            mean_mm: table.get("mean_mm")?.as_float()?,
            mixed_max_mm: table.get("mixed_max_mm").and_then(toml::Value::as_float),
            speed_mm_per_deg: table.get("speed_mm_per_deg")?.as_float()?,
            fastest: array(table, "fastest", owned_str)?,
            step_mm: table.get("step_mm")?.as_float()?,
            step_change_mm: table.get("step_change_mm")?.as_float()?,
            nearest: array(table, "nearest", owned_str)?,
            nearest_deg: table.get("nearest_deg")?.as_float()?,
            inside_poses: array(table, "inside_poses", |value| value.as_integer().and_then(|n| u64::try_from(n).ok()))?,
            inside_max_mm: table.get("inside_max_mm")?.as_float()?,
            targets: table.get("targets")?.as_array()?.iter().map(target).collect::<Option<_>>()?,
        })
    }
}

fn array<T, const N: usize>(
    table: &toml::Table,
    key: &str,
    read: impl Fn(&toml::Value) -> Option<T>,
) -> Option<[T; N]> {
    let values: Option<Vec<T>> = table.get(key)?.as_array()?.iter().map(read).collect();
    values?.try_into().ok()
}

fn owned_str(value: &toml::Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}

/// Three decimals.
fn rounded(figure: f32) -> f64 {
    (f64::from(figure) * 1e3).round() / 1e3
}

/// Metres as millimetres with three decimals.
fn rounded_mm(length_m: f32) -> f64 {
    (f64::from(length_m) * 1e6).round() / 1e3
}

/// The index as text, sorted by garment.
#[must_use]
pub fn to_text(index: &Index) -> String {
    let head = "# Written by `cargo xtask build-catalog`. max and mean: distance of each target from its file, blended\n\
                # alone; blended_max: in its pose with the garment's own kernel; paper_max and paper_mean: with the paper's;\n\
                # left_out: mean, p99 and max distance from what the other targets predict; mixed_max: what steps lose of\n\
                # random mixes of sizes. speed, steps (of 0.01 degrees) and nearest poses: the certificate of the blending.\n\
                # inside: how many poses the audit took, how many have cloth deeper than 2 mm and than 5 mm in the body, and\n\
                # how deep the deepest lies.\n";
    let entries = index.iter().map(|(id, entry)| format!("\n[{id}]\n{}", entry.to_text()));
    head.to_owned() + &entries.collect::<String>()
}

/// Reads the index, and the garments whose entries are none, because they lack a figure that an earlier version did not write. A
/// missing file is an empty index.
///
/// # Errors
/// When the file cannot be read, is no TOML (for example after a merge with conflicts), or has an entry whose name is no ID.
pub fn read(path: &Path) -> Result<(Index, Vec<String>), CatalogError> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Default::default()),
        Err(error) => return Err(CatalogError::io(path, &error)),
    };
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| CatalogError::Index {
        path: path.to_owned(),
        line: 1 + error.span().and_then(|span| text.get(..span.start)).map_or(0, |before| before.matches('\n').count()),
        problem: error.message().to_owned(),
    })?;
    let (mut index, mut unreadable) = (Index::new(), Vec::new());
    for (id, value) in table {
        // An ID becomes part of the paths that are written and removed.
        if !is_garment_id(&id) {
            let line = 1 + text.lines().position(|line| line.contains(&id)).unwrap_or(0);
            let problem = format!("`{id}` is no kimono's ID, which has only a-z, 0-9, _ and -");
            return Err(CatalogError::Index { path: path.to_owned(), line, problem });
        }
        match value.as_table().and_then(Entry::from_table) {
            Some(entry) => drop(index.insert(id, entry)),
            None => unreadable.push(id),
        }
    }
    Ok((index, unreadable))
}

/// What differs between two indices, one line each, for people.
#[must_use]
pub fn differences(old: &Index, new: &Index) -> Vec<String> {
    let ids: std::collections::BTreeSet<&String> = old.keys().chain(new.keys()).collect();
    let mut lines = Vec::new();
    for id in ids {
        match (old.get(id), new.get(id)) {
            (None, Some(_)) => lines.push(format!("{id}: is not in the index")),
            (Some(_), None) => lines.push(format!("{id}: is in the index, but its garment is gone")),
            (Some(old), Some(new)) if old != new => {
                let (old, new) = (old.to_text(), new.to_text());
                for (old, new) in old.lines().zip(new.lines()).filter(|(old, new)| old != new).take(3) {
                    lines.push(format!("{id}: `{}` becomes `{}`", old.trim(), new.trim()));
                }
            }
            _ => {}
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> Entry {
        let target = |name: &str| TargetEntry {
            name: name.into(),
            max_mm: 0.05,
            mean_mm: 0.0,
            blended_max_mm: 0.051,
            paper_max_mm: 12.125,
            paper_mean_mm: 1.5,
            left_out_mm: [1.0, 2.5, 30.125],
        };
        Entry {
            blake3: "00ff".into(),
            bytes: 10,
            target_bytes: 7,
            vertices: 3,
            triangles: 1,
            drivers: 2,
            max_mm: 0.05,
            mean_mm: 0.021,
            mixed_max_mm: Some(0.187),
            speed_mm_per_deg: 12.5,
            fastest: ["leftLowerArm", "base", "a_pose"].map(str::to_owned),
            step_mm: 0.125,
            step_change_mm: 0.001,
            nearest: ["base", "a_pose"].map(str::to_owned),
            nearest_deg: 45.0,
            inside_poses: [96, 80, 40],
            inside_max_mm: 41.5,
            targets: vec![target("a_pose"), target("odd \"name\" \\ 袖")],
        }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.toml");
        assert_eq!(read(&path).unwrap(), (Index::new(), Vec::new()), "no file, no packs");
        let index = Index::from([("komon".to_owned(), entry()), ("asagi-2".to_owned(), entry())]);
        std::fs::write(&path, to_text(&index)).unwrap();
        assert_eq!(read(&path).unwrap(), (index.clone(), Vec::new()));
        assert_eq!(differences(&index, &index), [""; 0]);
    }

    #[test]
    fn a_broken_index_is_an_error_that_names_the_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.toml");
        std::fs::write(&path, "[komon]\nbytes = 1\n<<<<<<< HEAD\n").unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("index.toml:3: ") && error.contains("; restore it, or delete it"), "{error}");
    }

    #[test]
    fn a_name_that_is_no_id_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.toml");
        for name in ["../../x/model", "", "Komon", "a/b", "..", "komon.old", "\u{5c0f}\u{7d0b}", &"a".repeat(300)] {
            std::fs::write(&path, format!("[komon]\nbytes = 1\n[\"{name}\"]\nbytes = 1\n")).unwrap();
            let error = read(&path).unwrap_err().to_string();
            assert!(error.contains("is no kimono's ID"), "{error}");
        }
    }

    #[test]
    fn an_entry_without_a_figure_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.toml");
        let whole = to_text(&Index::from([("asagi".to_owned(), entry()), ("komon".to_owned(), entry())]));
        std::fs::write(&path, whole.replacen("inside_max_mm = 41.500\n", "", 1)).unwrap();
        assert_eq!(read(&path).unwrap(), (Index::from([("komon".to_owned(), entry())]), vec!["asagi".to_owned()]));
    }

    #[test]
    fn differences_name_garment_and_line() {
        let old = Index::from([("komon".to_owned(), entry())]);
        let mut new = old.clone();
        new.get_mut("komon").unwrap().blake3 = "11".into();
        assert_eq!(differences(&old, &new), ["komon: `blake3 = \"00ff\"` becomes `blake3 = \"11\"`"]);
        assert_eq!(differences(&old, &Index::new()), ["komon: is in the index, but its garment is gone"]);
        assert_eq!(differences(&Index::new(), &old), ["komon: is not in the index"]);
    }
}
