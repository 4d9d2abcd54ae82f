//! What the report of a build says of the scans among the sizes: how far cloth and scan lie apart, what was seen, what it looks like.

use super::report::{picture, text};
use crate::look::laid_on::{self, LaidOn};
use crate::look::sheet::contact_sheet;
use crate::scans::{Laid, LaidScan};
use std::fmt::Write;

/// Width and height of a picture, pixels.
const SIDE_PX: u32 = 420;

/// The section of all scans; empty where there are none.
pub fn section(scans: &[LaidScan]) -> String {
    if scans.is_empty() {
        return String::new();
    }
    let mut section = String::from(
        "<h2>Scans</h2><p>Sizes that were made of scans: the base was laid onto each. Distances in mm, at most 100. Pictures: the scan (yellow) and the cloth (blue) at one \
         place; the scan, red where it lies 10 mm from the cloth; the cloth, red where it was not seen.</p>",
    );
    for LaidScan { file, body, line, triangles, laid } in scans {
        let _ = write!(section, "<h3>{}</h3>{}", text(file), figures(laid, body, *line));
        let pictures = laid_on::pictures(
            &LaidOn {
                cloth_m: &laid.positions_m,
                triangles,
                confidence: &laid.confidence,
                scan_m: &laid.scan_m,
                scan_triangles: &laid.scan_triangles,
                from_scan_m: &laid.from_scan_m,
            },
            SIDE_PX,
        );
        let what = "the scan and the cloth laid onto it, how far they lie apart, and what was not seen, from the front and behind";
        section += &picture(&contact_sheet(&pictures, laid_on::COLUMNS), what);
    }
    section
}

fn figures(laid: &Laid, body: &str, line: u32) -> String {
    let mut table = String::from("<table><tr><th>mm<th>mean<th>median<th>95 %<th>largest</tr>");
    for (what, distances_m) in [("base to scan", &laid.to_scan_m), ("scan to base", &laid.from_scan_m)] {
        let [mean, median, p95, max] = spread_mm(distances_m);
        let _ = write!(table, "<tr><td>{what}<td>{mean:.2}<td>{median:.2}<td>{p95:.2}<td>{max:.2}</tr>");
    }
    let borders =
        |lengths_m: &[f64]| format!("{}, {:.0} mm in all", lengths_m.len(), lengths_m.iter().sum::<f64>() * 1e3);
    let rows = [
        ("size", format!("of {body}, line {line} of the size table")),
        (
            "seen",
            format!("{:.1} % of the {} vertices that a scanner can see", 100.0 * laid.seen(), laid.to_scan_m.len()),
        ),
        ("triangles turned over", laid.turned.to_string()),
        ("rigidly laid on", format!("{:.1} mm apart on average", 1e3 * laid.aligned_m)),
        ("holes in the cleaned scan", borders(&laid.holes_m)),
        ("openings, such as a hem", borders(&laid.openings_m)),
    ];
    table += "</table><table>";
    for (what, figure) in rows {
        let _ = write!(table, "<tr><td>{what}<td style=\"text-align:left\">{}</tr>", text(&figure));
    }
    table + "</table>"
}

/// Mean, median, 95 % and largest, millimetres.
fn spread_mm(distances_m: &[f64]) -> [f64; 4] {
    let mut sorted = distances_m.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().saturating_sub(1) as f64;
    let at_mm = |share: f64| sorted.get((last * share).round() as usize).map_or(0.0, |d| d * 1e3);
    let mean_mm = sorted.iter().sum::<f64>() / sorted.len().max(1) as f64 * 1e3;
    [mean_mm, at_mm(0.5), at_mm(0.95), at_mm(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_told_in_millimetres() {
        let distances_m: Vec<f64> = (0..=100).rev().map(|i| f64::from(i) * 1e-3).collect();
        assert_eq!(spread_mm(&distances_m).map(|mm| format!("{mm:.3}")), ["50.000", "50.000", "95.000", "100.000"]);
        assert_eq!(spread_mm(&[]), [0.0; 4]);
    }
}
