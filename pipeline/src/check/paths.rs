//! Measured paths: whether they run along edges of the base, and whether they are about as long as the kimono's own rules say. Knows no
//! sizes but the base's.

use super::{mesh, value};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir::Surface;
use crate::source::closest;
use crate::source::manifest::Field;
use crate::source::paths::{PathEntry, Paths};
use crate::source::rules;
use glam::Vec3;
use kitsuke::measurement::Measurements;
use kitsuke::tailoring::RuleSet;

/// How much a path may count in a fit.
const LOAD: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// How far the length of a path may lie from its dimension, as a share: on a sample no more than 0.03 by its own rules, and 0.1 by those
/// of two other tailors.
const OFF: f32 = 0.15;

/// Reports paths that do not run along edges of the base; true when all do.
pub(super) fn check(paths: &Paths, file: &str, base_file: &str, base: &Surface, report: &mut Vec<Diagnostic>) -> bool {
    let edges = mesh::edges(&base.triangles);
    let count = base.positions_m.len();
    let is_from_one = |path: &PathEntry| !runs_on_edges(path, 0, &edges) && runs_on_edges(path, 1, &edges);
    let from_one: Vec<&String> = paths.0.iter().filter(|(_, path)| is_from_one(path)).map(|(name, _)| name).collect();
    // Of columns of a grid the next one is a path, too: one that is none speaks for all.
    let all_from_one = !from_one.is_empty() && paths.0.values().all(|path| runs_on_edges(path, 1, &edges));
    if let (true, Some(name)) = (all_from_one, from_one.first()) {
        let place = paths.0[*name].vertices.iter().flatten().next().map_or(Place::File, Field::place);
        report.push(
            Diagnostic::error("path-off-edge", file, place)
                .problem(format!("the path {name} leaves the edges of {base_file}; with every number one less all paths run along edges"))
                .help("Vertices are numbered from 0, but in OBJ files from 1: subtract 1 from every number of this file."),
        );
    }
    for (name, path) in &paths.0 {
        if let (Some(field), Some(load)) = (&path.load, value(&path.load))
            && !LOAD.contains(load)
        {
            report.push(
                Diagnostic::error("path-load", file, field.place())
                    .problem(format!("a load of {load} makes the path {name} count for nothing or for everything"))
                    .help("Choose 0.001 to 1000; 1 is usual."),
            );
        }
        if let (Some(field), Some(rule)) = (&path.rule, value(&path.rule))
            && !rules::DIMENSIONS.iter().any(|(known, _)| known == rule)
        {
            let problem = match closest(rule, rules::DIMENSIONS.iter().map(|(known, _)| *known)) {
                Some(similar) => format!("the rule sets have no dimension `{rule}`; did you mean `{similar}`?"),
                None => format!("the rule sets have no dimension `{rule}`"),
            };
            let all: Vec<&str> = rules::DIMENSIONS.iter().map(|(known, _)| *known).collect();
            report.push(
                Diagnostic::error("path-rule", file, field.place())
                    .problem(problem)
                    .help(format!("The dimensions are {}.", all.join(", "))),
            );
        }
        let Some(vertices) = &path.vertices else { continue };
        let known: Vec<(Place, u32)> =
            vertices.iter().filter_map(|field| Some((field.place(), *field.get()?))).collect();
        if vertices.len() < 2 {
            report.push(
                Diagnostic::error("short-path", file, vertices.first().map_or(Place::File, Field::place))
                    .problem(format!("the path {name} joins no two vertices"))
                    .help("A path needs two or more vertices."),
            );
        }
        for (place, vertex) in &known {
            if *vertex as usize >= count {
                report.push(
                    Diagnostic::error("path-vertex", file, place.clone())
                        .problem(format!("vertex {vertex} of the path {name} does not exist in {base_file}"))
                        .help(format!("Vertices are numbered from 0 to {}.", count.saturating_sub(1))),
                );
            }
        }
        if from_one.contains(&name) {
            if !all_from_one {
                report.push(
                    Diagnostic::error("path-off-edge", file, vertices.first().map_or(Place::File, Field::place))
                        .problem(format!("the path {name} leaves the edges of {base_file}; with every number one less it runs along edges"))
                        .help("Vertices are numbered from 0, but in OBJ files from 1: subtract 1 from the numbers of this path."),
                );
            }
            continue;
        }
        for pair in known.windows(2) {
            let ((_, from), (place, to)) = (&pair[0], &pair[1]);
            let is_edge = edges.binary_search(&[*from.min(to), *from.max(to)]).is_ok();
            if !is_edge && (*from.max(to) as usize) < count {
                report.push(
                    Diagnostic::error("path-off-edge", file, place.clone())
                        .problem(format!("no edge of {base_file} joins vertices {from} and {to} of the path {name}"))
                        .help("Name every vertex on the way, from neighbour to neighbour, numbered from 0."),
                );
            }
        }
    }
    paths.0.values().all(|path| runs_on_edges(path, 0, &edges))
}

/// The vertices of a path, `less` subtracted from each; nothing where one is wrong.
fn numbers(path: &PathEntry, less: u32) -> Option<Vec<u32>> {
    path.vertices.as_ref()?.iter().map(|field| field.get()?.checked_sub(less)).collect()
}

fn runs_on_edges(path: &PathEntry, less: u32, edges: &[[u32; 2]]) -> bool {
    let is_edge = |pair: &[u32]| edges.binary_search(&[pair[0].min(pair[1]), pair[0].max(pair[1])]).is_ok();
    numbers(path, less).is_some_and(|vertices| vertices.windows(2).all(is_edge))
}

/// Length of a path with its offset, metres.
fn length_m(path: &PathEntry, less: u32, positions_m: &[Vec3]) -> Option<f32> {
    let at = |v: u32| positions_m.get(v as usize);
    let vertices = numbers(path, less)?;
    let edge_m = |pair: &[u32]| Some(at(pair[0])?.distance(*at(pair[1])?));
    Some(vertices.windows(2).map(edge_m).sum::<Option<f32>>()? + offset_m(path))
}

fn offset_m(path: &PathEntry) -> f32 {
    path.offset.map_or(0.0, |offset| offset.metres() as f32)
}

/// The dimension that a path's rule gives, metres.
fn wanted_m(path: &PathEntry, rules: &RuleSet, dimensions_m: &[f32]) -> Option<f32> {
    dimensions_m.get(rules.index_of(value(&path.rule)?)?).copied()
}

/// Reports paths that are much longer or shorter on the base than the kimono's own rules, the first ones, say for the body of the base.
pub(super) fn check_lengths(
    paths: &Paths,
    file: &str,
    positions_m: &[Vec3],
    body: &Measurements,
    rules: &[&RuleSet],
    report: &mut Vec<Diagnostic>,
) {
    let is_off = |has_m: f32, wanted_m: f32| wanted_m > 0.0 && (has_m / wanted_m - 1.0).abs() > OFF;
    let off = |rules: &RuleSet| -> Option<Vec<(&String, &PathEntry, f32, f32)>> {
        let dimensions = rules.dimensions(body).ok()?;
        let lengths = paths.0.iter().filter_map(|(name, path)| {
            Some((name, path, length_m(path, 0, positions_m)?, wanted_m(path, rules, &dimensions.0)?))
        });
        Some(lengths.filter(|(.., has_m, wanted_m)| is_off(*has_m, *wanted_m)).collect())
    };
    let Some(own) = rules.first() else { return };
    let Some(wrong) = off(own) else { return };
    let fits = rules[1..].iter().find(|other| wrong.len() > 1 && off(other).is_some_and(|wrong| wrong.is_empty()));
    if let Some(fits) = fits {
        report.push(
            Diagnostic::warning("path-length", file, Place::File)
                .problem(format!(
                    "{} paths have other lengths than {} gives for the base's body, but those that {} gives",
                    wrong.len(),
                    own.name,
                    fits.name
                ))
                .help(format!(
                    "Name {} first in `rules` of garment.toml: the first rules are those by which the kimono was made.",
                    fits.name
                )),
        );
        return;
    }
    for (name, path, has_m, wanted_m) in wrong {
        let offset_m = offset_m(path);
        let of_which = match offset_m {
            0.0 => String::new(),
            offset_m => format!(" (of which its offset {:.1} cm)", 100.0 * offset_m),
        };
        let mut problem = format!(
            "the path {name} is {:.1} cm long{of_which}, but {} gives {:.1} cm for the base's body",
            100.0 * has_m,
            own.name,
            100.0 * wanted_m
        );
        let mut help = "Look whether the path begins and ends where the dimension does, and whether its rule and its offset are right.";
        if let Some(from_one_m) = length_m(path, 1, positions_m).filter(|m| !is_off(*m, wanted_m)) {
            problem += &format!("; with every number one less it is {:.1} cm", 100.0 * from_one_m);
            help = "Vertices are numbered from 0, but in OBJ files from 1: subtract 1 from the numbers of this path.";
        } else if offset_m.abs() > wanted_m {
            help = "Look at the unit of its offset.";
        }
        let place = path.rule.as_ref().map_or(Place::File, Field::place);
        report.push(Diagnostic::warning("path-length", file, place).problem(problem).help(help));
    }
}
