//! What is allowed and yet hardly meant: a single target, poses of one side alone, groups of drivers that differ by a slip of the pen.
//! Knows no mesh.

use super::poses::is_near;
use super::value;
use crate::diagnostic::{Diagnostic, Place};
use crate::source::manifest::{Field, Manifest};
use crate::source::tables::PoseTable;
use glam::Quat;
use std::collections::BTreeMap;

/// Poses that leave most of the kimono as it is.
pub(super) fn check(table: &PoseTable, file: &str, report: &mut Vec<Diagnostic>) {
    if let [_, target] = &table.rows[..] {
        report.push(
            Diagnostic::warning("one-target", file, Place::Line(target.line))
                .problem(format!("`{}` is the only target", target.name))
                .help("Drape more poses: one shape cannot show how sleeves follow the arms; README.md lists good first poses."),
        );
        return;
    }
    let is_turned = |side: &str| {
        let of_side = table.bones.iter().enumerate().filter(|(_, bone)| bone.name().starts_with(side));
        of_side.into_iter().any(|(i, _)| table.rows.iter().any(|row| !is_near(row.rotations[i], Quat::IDENTITY)))
    };
    let (turned, still) = match (is_turned("left"), is_turned("right")) {
        (true, false) => ("left", "right"),
        (false, true) => ("right", "left"),
        _ => return,
    };
    report.push(
        Diagnostic::warning("one-sided", file, Place::File)
            .problem(format!("all targets turn joints of the {turned} side only, so the {still} side has no shapes"))
            .help(format!("Drape poses of the {still} side, too, or of both together.")),
    );
}

/// Groups whose names differ by one letter, at least one of them with a single driver.
pub(super) fn check_groups(manifest: &Manifest, file: &str, report: &mut Vec<Diagnostic>) {
    let mut groups: BTreeMap<&str, (usize, &Field<String>)> = BTreeMap::new();
    for driver in &manifest.drivers {
        if let (Some(field), Some(name)) = (&driver.group, value(&driver.group)) {
            groups.entry(name).or_insert((0, field)).0 += 1;
        }
    }
    for (name, (count, field)) in &groups {
        // The rarer name is the slip; of two that are equally rare the later one.
        let is_meant = |(other, (others, _)): &(&&str, &(usize, &Field<String>))| {
            is_slip(name, other) && *count == 1 && (*others > 1 || **other < *name)
        };
        if let Some((meant, _)) = groups.iter().find(is_meant) {
            report.push(
                Diagnostic::warning("group-name", file, field.place())
                    .problem(format!("the group `{name}` has one driver, and there is a group `{meant}`"))
                    .help("If they are meant to be one, write the name alike: drivers of one group blend together."),
            );
        }
    }
}

/// Whether two names differ by one letter or by upper and lower case; other last letters or digits (`armL`, `armR`) are no slip.
fn is_slip(a: &str, b: &str) -> bool {
    let stem = |name: &str| name.char_indices().next_back().map_or(String::new(), |(last, _)| name[..last].to_owned());
    a != b && stem(a) != stem(b) && strsim::damerau_levenshtein(&a.to_lowercase(), &b.to_lowercase()) <= 1
}

#[cfg(test)]
mod tests {
    #[test]
    fn slips_are_told_from_schemes() {
        for (a, b) in
            [("rightArm", "rightAm"), ("legs", "leg"), ("legs", "Legs"), ("leftArm", "lefrArm"), ("arm", "amr")]
        {
            assert!(super::is_slip(a, b), "{a} {b}");
        }
        for (a, b) in
            [("leftArm", "rightArm"), ("armL", "armR"), ("arm1", "arm2"), ("a", "b"), ("arm", "legs"), ("", "a")]
        {
            assert!(!super::is_slip(a, b), "{a} {b}");
        }
    }
}
