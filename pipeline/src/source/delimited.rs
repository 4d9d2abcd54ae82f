//! Tables of cells between commas, semicolons or tabs, as spreadsheets save them: blank rows and columns are passed over.
//! Knows no meaning of any column.

use super::causes::Causes;
use crate::diagnostic::{Diagnostic, Place};

/// Most columns of a table.
const COLUMNS: usize = 1000;

/// A table's cells, without blanks about them.
pub(super) struct Cells {
    /// The names of the columns.
    pub header: Vec<String>,
    /// Where they stand.
    pub header_place: Place,
    /// Each as long as the header.
    pub rows: Vec<Row>,
}

/// A row of a table.
pub(super) struct Row {
    /// Which row of the table, counted from 1; blank rows do not count.
    pub number: usize,
    /// Which line of the file, counted from 1.
    pub line: u32,
    pub cells: Vec<String>,
}

/// Counts lines up to places that come in order.
struct Lines<'a> {
    text: &'a [u8],
    counted: usize,
    line: u32,
}

impl Lines<'_> {
    /// The line of the first text at or after a byte; the place that csv gives may lie before the end of the line above.
    fn at(&mut self, byte: u64) -> u32 {
        let from = (byte as usize).clamp(self.counted, self.text.len());
        let blank = self.text[from..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
        let passed = &self.text[self.counted..from + blank];
        // Old Macs end lines by carriage returns alone.
        let is_end = |(i, &byte): (usize, &u8)| byte == b'\n' || byte == b'\r' && passed.get(i + 1) != Some(&b'\n');
        self.line += passed.iter().enumerate().filter(|&at| is_end(at)).count() as u32;
        self.counted = from + blank;
        self.line
    }
}

/// What separates the columns of a header.
pub(super) fn separator(header: &[u8]) -> u8 {
    let count = |separator: u8| header.iter().filter(|&&byte| byte == separator).count();
    // Of equals the last, the comma.
    [b'\t', b';', b','].into_iter().max_by_key(|&separator| count(separator)).unwrap_or(b',')
}

/// The first line that is not blank.
pub(super) fn first_line(text: &str) -> &str {
    text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default()
}

/// Reads a table of at most `most` rows; nothing where it is no table. Rows that do not fit the header are reported and left out.
pub(super) fn read(file: &str, text: &str, separator: u8, most: usize, report: &mut Vec<Diagnostic>) -> Option<Cells> {
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let error = |code, line| Diagnostic::error(code, file, Place::Line(line));
    let mut lines = Lines { text: text.as_bytes(), counted: 0, line: 1 };
    let mut columns = None;
    let mut cells = Cells { header: Vec::new(), header_place: Place::Line(1), rows: Vec::new() };
    let mut causes = Causes::default();
    let (mut record, mut number) = (csv::StringRecord::new(), 0);
    loop {
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => {
                let place = error.position().map_or(Place::File, |at| Place::Line(at.line() as u32));
                report.push(
                    Diagnostic::error("csv-syntax", file, place)
                        .problem(format!("this is no row of a CSV table: {error}"))
                        .help("Separate columns by commas; put text with commas in double quotes."),
                );
                return None;
            }
        }
        if record.iter().all(str::is_empty) {
            continue;
        }
        let line = lines.at(record.position().map_or(0, csv::Position::byte));
        let Some(columns) = &columns else {
            if record.len() > COLUMNS {
                report.push(
                    error("csv-syntax", line)
                        .problem(format!("the table has {} columns, more than {COLUMNS}", record.len()))
                        .help("Keep the columns that are measurements."),
                );
                return None;
            }
            let named: Vec<usize> = (0..record.len()).filter(|&i| !record[i].is_empty()).collect();
            cells.header = named.iter().map(|&i| record[i].to_owned()).collect();
            cells.header_place = Place::Line(line);
            columns = Some(named);
            continue;
        };
        if number == most {
            report.push(
                error("table-row", line).problem(format!("the table has more than {most} rows")).help("Split it."),
            );
            return None;
        }
        number += 1;
        match fitting(&record, columns, separator) {
            Ok(()) => {
                let row = columns.iter().map(|&i| record[i].to_owned()).collect();
                cells.rows.push(Row { number, line, cells: row });
            }
            Err((problem, help)) => {
                causes.add("table-row", problem.clone(), || error("table-row", line).problem(problem).help(help));
            }
        }
    }
    causes.report("row", report);
    Some(cells)
}

/// Whether a row has all columns that the header names and nothing else; if not, what is wrong and what to do.
fn fitting(record: &csv::StringRecord, named: &[usize], separator: u8) -> Result<(), (String, &'static str)> {
    let wanted = named.last().map_or(0, |last| last + 1);
    if record.len() < wanted {
        if record.iter().any(|cell| cell.contains('\n')) {
            let problem = "a double quote is opened in this row and closed only lines later, or never";
            return Err((problem.to_owned(), "Remove the quote, or double it inside a quoted text."));
        }
        let problem = format!("this row has {} columns, the header {wanted}", record.len());
        return Err((problem, "Give every row one value per column of the header."));
    }
    let stray = |&i: &usize| !record[i].is_empty() && named.binary_search(&i).is_err();
    let Some(stray) = (0..record.len()).find(stray) else { return Ok(()) };
    if stray < wanted {
        let problem = format!("the column {} has a value but no name in the header", letters(stray));
        return Err((problem, "Name the column in the header, or delete it."));
    }
    let count = 1 + (0..record.len()).rfind(|&i| !record[i].is_empty()).unwrap_or(0);
    let problem = format!("this row has {count} columns, the header {wanted}");
    match separator {
        b',' => Err((problem, "Give every row one value per column; decimals take a point, not a comma.")),
        _ => Err((problem, "Give every row one value per column of the header.")),
    }
}

/// A column's name in spreadsheets: A, B, …, Z, AA, …
fn letters(mut column: usize) -> String {
    let mut name = String::new();
    loop {
        name.insert(0, char::from(b'A' + (column % 26) as u8));
        match column / 26 {
            0 => return name,
            rest => column = rest - 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_the_file_and_blank_rows_and_columns_are_passed_over() {
        for end in ["\n", "\r\n", "\r"] {
            let text = [
                ",,,", "a,,b,", "", "1,,2,", ",,,", "  , ,,", "\"x", "y\",,3,", "", "4,,5", "", "6", "7,8,9", "1,,2,3",
            ]
            .join(end);
            let mut report = Vec::new();
            let cells = read("t.csv", &text, b',', 10, &mut report).unwrap();
            assert_eq!(
                (&cells.header[..], &cells.header_place),
                (&["a".to_owned(), "b".to_owned()][..], &Place::Line(2))
            );
            let rows: Vec<(usize, u32, &str)> =
                cells.rows.iter().map(|r| (r.number, r.line, &r.cells[1][..])).collect();
            assert_eq!(rows, [(1, 4, "2"), (2, 7, "3"), (3, 10, "5")], "{end:?}");
            let mut said: Vec<(Place, &str)> = report.iter().map(|d| (d.place.clone(), &d.problem[..])).collect();
            said.sort_by_key(|(place, _)| if let Place::Line(line) = place { *line } else { 0 });
            let wanted = [
                (Place::Line(12), "this row has 1 columns, the header 3"),
                (Place::Line(13), "the column B has a value but no name in the header"),
                (Place::Line(14), "this row has 4 columns, the header 3"),
            ];
            assert_eq!(said, wanted, "{end:?}");
        }
        assert_eq!([0, 25, 26, 27, 701, 702].map(letters), ["A", "Z", "AA", "AB", "ZZ", "AAA"]);
    }
}
