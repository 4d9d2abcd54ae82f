//! What is said of shapes that are not in the poses of their rows. Knows words alone; [`super::pose_fit`] finds the faults.

use super::pose_fit::{Fault, Guess, ORDERS};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::tables::{PoseRow, PoseTable};

/// What is said of shapes that are not in the poses of their rows.
pub(super) fn diagnostic(fault: &Fault, table: &PoseTable, file: &str, targets: &[ir::TargetShape]) -> Diagnostic {
    let line = |target: usize| {
        let row = table
            .rows
            .iter()
            .find(|row: &&PoseRow| row.name == targets[target].name && row.file == targets[target].file);
        row.map_or(Place::File, |row| Place::Line(row.line))
    };
    let named = |target: usize| match line(target) {
        Place::Line(line) => format!("`{}` (line {line})", targets[target].name),
        _ => format!("`{}`", targets[target].name),
    };
    match fault {
        Fault::Table(guess, off, rows) => {
            let problem = match guess {
                Guess::Unknown => format!("{off} of {rows} shapes of arms do not go where their rows turn the body"),
                _ => format!(
                    "the shapes of the table do not go where their rows turn the body, but {}",
                    said_of_guess(*guess)
                ),
            };
            Diagnostic::error("pose-table", file, Place::File).problem(problem).help(help_of_guess(*guess, true))
        }
        Fault::Row(target, apart_m, guess) => {
            let but = match guess {
                Guess::Unknown => String::new(),
                Guess::Row(other) => format!("; the pose of {} fits", named(*other)),
                guess => format!("; {}", said_of_guess(*guess)),
            };
            let problem = format!(
                "the shape of `{}` is not in the pose of its row, which would carry it {:.0} cm from there{but}",
                targets[*target].name,
                100.0 * apart_m
            );
            let diagnostic = match guess {
                Guess::Unknown => Diagnostic::warning("pose-shape", file, line(*target)),
                _ => Diagnostic::error("pose-shape", file, line(*target)),
            };
            diagnostic.problem(problem).help(help_of_guess(*guess, false))
        }
        Fault::Exchanged(a, b) => Diagnostic::error("pose-shape", file, line(*b))
            .problem(format!("the shapes of {} and `{}` are in each other's poses", named(*a), targets[*b].name))
            .help("Exchange the two file names, or the rotations of the two rows."),
    }
}

/// What is said of each of [`super::pose_fit::ORDERS`].
const ORDER_FITS: [&str; ORDERS.len()] = [
    "angles turned in another order fit better, for example first about Z, then Y, then X",
    "angles turned in another order fit better, for example first about X, then Z, then Y",
    "angles turned in another order fit better, for example first about Y, then X, then Z",
    "angles turned in another order fit better, for example first about Y, then Z, then X",
    "angles turned in another order fit better, for example first about Z, then X, then Y",
];

fn said_of_guess(guess: Guess) -> &'static str {
    match guess {
        Guess::Negated => "every rotation the other way fits",
        Guess::SidesExchanged => "left and right with exchanged rotations fit",
        Guess::Mirrored => "the mirrored pose fits",
        Guess::Half => "half the angles fit",
        Guess::Double => "twice the angles fit",
        Guess::World => "read as rotations of the world, not of the joint above, they fit better",
        Guess::Order(number) => ORDER_FITS[number],
        Guess::Row(_) | Guess::Unknown => "nothing that is known fits",
    }
}

fn help_of_guess(guess: Guess, is_whole_table: bool) -> &'static str {
    match guess {
        Guess::Negated => "Negate qx, qy and qz of the rotations, or the sign of the angles that they were made from.",
        Guess::SidesExchanged => "Exchange the columns of left and right joints; left is the wearer's own left, at +X.",
        Guess::Mirrored => "Exchange left and right, and negate qy and qz; or export the shapes without mirroring.",
        Guess::Half => {
            "A quaternion holds half the angle: qw = cos(angle / 2), and qx, qy, qz = axis times sin(angle / 2)."
        }
        Guess::Double => "A quaternion holds half the angle, not a quarter: qw = cos(angle / 2).",
        Guess::World => {
            "Give each joint's rotation relative to the joint that it hangs on: multiply it by the inverse of that one's, from the left."
        }
        Guess::Order(_) => {
            "Angles turn first about X, then Y, then Z, of axes that stay: choose this order where they are written, or give quaternions."
        }
        Guess::Row(_) => {
            "Look whether the file was exported again after the pose was changed, and whether it has the right name."
        }
        Guess::Unknown if is_whole_table => {
            "Drape the base in the T-pose, and give each joint's rotation from the T-pose in the axes of the file (X to the wearer's left, Y up, \
             Z to the front), relative to the joint that it hangs on."
        }
        Guess::Unknown => "Look at the shape and at the rotations of its row.",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::tables;

    #[test]
    fn words_name_rows_by_line_and_say_what_to_do() {
        let text = "file,name,leftUpperArm_qx,leftUpperArm_qy,leftUpperArm_qz,leftUpperArm_qw\n\
                    base.obj,base,0,0,0,1\na.obj,down,0,0,-0.5,0.8660254\nb.obj,up,0,0,0.5,0.8660254\n";
        let table = tables::read("poses", text.as_bytes(), &mut Vec::new()).unwrap();
        let shape = |row: &PoseRow| ir::TargetShape {
            name: row.name.clone(),
            file: row.file.clone(),
            layer: 0,
            rotations: Vec::new(),
            positions_m: Vec::new(),
        };
        let targets: Vec<ir::TargetShape> = table.rows[1..].iter().map(shape).collect();
        let cases = [
            (Fault::Table(Guess::Negated, 9, 9), Place::File, "every rotation the other way", "Negate qx"),
            (Fault::Table(Guess::Unknown, 5, 9), Place::File, "5 of 9 shapes of arms", "T-pose"),
            (Fault::Row(1, 0.123, Guess::Row(0)), Place::Line(4), "`up` is not in the pose", "the right name"),
            (
                Fault::Row(0, 0.123, Guess::Double),
                Place::Line(3),
                "12 cm from there; twice the angles",
                "cos(angle / 2)",
            ),
            (Fault::Exchanged(0, 1), Place::Line(4), "`down` (line 3) and `up` are in each other's", "Exchange"),
        ];
        for (fault, place, problem, help) in cases {
            let said = diagnostic(&fault, &table, "poses", &targets);
            assert_eq!(said.place, place, "{said:?}");
            assert!(said.problem.contains(problem) && said.help.contains(help), "{said:?}");
        }
    }
}
