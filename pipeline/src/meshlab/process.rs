//! One process: input in, output out, ended when its time is up. Knows neither Python nor meshes.

use std::io::{Read, Write};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Bytes of output that are kept; an answer of a large scan is some hundred kilobytes.
const OUTPUT_BYTES: u64 = 64 << 20;
/// Lines and bytes of the error output that are told.
const TAIL_LINES: usize = 12;
const TAIL_BYTES: usize = 4096;
/// How long the output of an ended process is waited for: a process that it left behind may hold the pipe open.
const PIPE_WAIT: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(5);

/// How a process ended.
#[derive(Debug)]
pub struct Ended {
    /// `None` where its time was up.
    pub status: Option<ExitStatus>,
    /// Its output.
    pub stdout: Vec<u8>,
    /// The last lines of its error output.
    pub tail: String,
}

impl Ended {
    /// Exit code or signal, in words.
    #[must_use]
    pub fn how(&self) -> String {
        let Some(status) = self.status else { return "nothing, its time being up".to_owned() };
        #[cfg(unix)]
        if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
            // What the kernel does when memory runs out.
            let memory = if signal == 9 { ", perhaps because memory ran out" } else { "" };
            return format!("signal {signal}{memory}");
        }
        status.code().map_or_else(|| status.to_string(), |code| format!("exit code {code}"))
    }
}

/// Runs a command with this input. The process is always reaped, and ended where it runs longer than `limit`.
///
/// # Errors
/// It cannot be started.
pub fn run(command: &mut Command, input: &[u8], limit: Option<Duration>) -> std::io::Result<Ended> {
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
    let start = Instant::now();
    let stdout = collected(child.stdout.take().expect("it is piped"), |from| {
        let mut bytes = Vec::new();
        let _ = from.take(OUTPUT_BYTES).read_to_end(&mut bytes);
        bytes
    });
    let tail = collected(child.stderr.take().expect("it is piped"), last_bytes);
    let mut stdin = child.stdin.take().expect("it is piped");
    let input = input.to_vec();
    // A process that does not read ends without its input; how it ends says why.
    std::thread::spawn(move || _ = stdin.write_all(&input));
    let status = wait(&mut child, start, limit);
    Ok(Ended {
        status,
        stdout: stdout.recv_timeout(PIPE_WAIT).unwrap_or_default(),
        tail: last_lines(&tail.recv_timeout(PIPE_WAIT).unwrap_or_default()),
    })
}

fn wait(child: &mut Child, start: Instant, limit: Option<Duration>) -> Option<ExitStatus> {
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if limit.is_none_or(|limit| start.elapsed() < limit) => std::thread::sleep(POLL),
            _ => {
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
        }
    }
}

fn collected<R: Read + Send + 'static>(
    from: R,
    collect: impl FnOnce(R) -> Vec<u8> + Send + 'static,
) -> Receiver<Vec<u8>> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || _ = sender.send(collect(from)));
    receiver
}

fn last_bytes(mut from: impl Read) -> Vec<u8> {
    let (mut last, mut block) = (Vec::new(), [0; TAIL_BYTES]);
    while let Ok(count @ 1..) = from.read(&mut block) {
        last.extend_from_slice(&block[..count]);
        last.drain(..last.len().saturating_sub(TAIL_BYTES));
    }
    last
}

/// The last lines of an output, without what a terminal would obey.
pub fn last_lines(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let shown = lines[lines.len().saturating_sub(TAIL_LINES)..].join("\n");
    shown.chars().filter(|&c| c == '\n' || !c.is_control()).collect()
}
