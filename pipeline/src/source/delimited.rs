//! Tables of cells between commas, semicolons or tabs. Knows no meaning of any column.

use crate::diagnostic::{Diagnostic, Place};

/// Most columns of a table.
const COLUMNS: usize = 1000;

/// A table's cells, without blanks about them.
pub(super) struct Cells {
    /// The names of the columns.
    pub header: Vec<String>,
    /// Each as long as the header.
    pub rows: Vec<Row>,
}

/// A row of a table.
pub(super) struct Row {
    /// Which row of the table, counted from 1.
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
        let newlines = self.text[self.counted..from + blank].iter().filter(|&&byte| byte == b'\n').count();
        self.line += newlines as u32;
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

/// Reads a table of at most `most` rows; nothing where it is no table. Rows of another length than the header are reported
/// and left out.
pub(super) fn read(file: &str, text: &str, separator: u8, most: usize, report: &mut Vec<Diagnostic>) -> Option<Cells> {
    let mut reader =
        csv::ReaderBuilder::new().delimiter(separator).flexible(true).trim(csv::Trim::All).from_reader(text.as_bytes());
    let unreadable = |error: csv::Error| {
        let place = error.position().map_or(Place::File, |at| Place::Line(at.line() as u32));
        Diagnostic::error("csv-syntax", file, place)
            .problem(format!("this is no row of a CSV table: {error}"))
            .help("Separate columns by commas; put text with commas in double quotes.")
    };
    let header: Vec<String> = match reader.headers() {
        Ok(header) => header.iter().map(str::to_owned).collect(),
        Err(error) => {
            report.push(unreadable(error));
            return None;
        }
    };
    if header.len() > COLUMNS {
        report.push(
            Diagnostic::error("csv-syntax", file, Place::Line(1))
                .problem(format!("the table has {} columns, more than {COLUMNS}", header.len()))
                .help("Keep the columns that are measurements."),
        );
        return None;
    }
    let mut rows = Vec::new();
    let mut lines = Lines { text: text.as_bytes(), counted: 0, line: 1 };
    for (i, record) in reader.records().enumerate() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                report.push(unreadable(error));
                return None;
            }
        };
        let line = lines.at(record.position().map_or(0, csv::Position::byte));
        if i == most {
            report.push(
                Diagnostic::error("table-row", file, Place::Line(line))
                    .problem(format!("the table has more than {most} rows"))
                    .help("Split it."),
            );
            return None;
        }
        if record.len() != header.len() {
            let help = match separator {
                b',' if record.len() > header.len() => {
                    "Give every row one value per column; decimals take a point, not a comma."
                }
                _ => "Give every row one value per column of the header.",
            };
            report.push(
                Diagnostic::error("table-row", file, Place::Line(line))
                    .problem(format!("this row has {} columns, the header {}", record.len(), header.len()))
                    .help(help),
            );
            continue;
        }
        rows.push(Row { number: i + 1, line, cells: record.iter().map(str::to_owned).collect() });
    }
    Some(Cells { header, rows })
}
