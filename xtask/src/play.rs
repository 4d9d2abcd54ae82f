//! `cargo xtask play`: a live wearer in a kimono, and how well it goes.

use crate::places::{Places, ended};
use crate::shots::{self, FilterName};
use crate::wearers;
use glam::Vec3;
use kitsuke::skeleton::filter::{Filter, FilterState};
use kitsuke::skeleton::vmc::Counters;
use kitsuke::skeleton::{Bone, Skeleton, Tracked, jsonl, vrma};
use kitsuke::{Frame, Garment, Scratch, evaluate};
use kitsuke_live::{Listener, Settings};
use std::fs::File;
use std::io::Write;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Ctrl-C is noticed this soon.
const STOPPED_WITHIN: Duration = Duration::from_millis(100);

/// Receive a live wearer in the VMC protocol, evaluate the kimono for every pose and print live figures
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID, or the path of a pack
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    /// Fit the kimono to the Nth body of a table, from 1, before it is worn
    #[arg(long, value_name = "FILE#N")]
    body: Option<String>,
    /// The rule set of the fit [default: the kimono's own]
    #[arg(long, value_name = "NAME", requires = "body")]
    rules: Option<String>,
    /// Address and port to listen at; whoever reaches it can move the wearer
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = kitsuke_live::address, default_value_t = kitsuke_live::DEFAULT_ADDRESS)]
    vmc: SocketAddr,
    /// Count only what comes from here
    #[arg(long, value_name = "ADDRESS")]
    source: Option<IpAddr>,
    /// End after so many seconds [default: on Ctrl-C]; the totals come last
    #[arg(long, value_name = "N", value_parser = seconds)]
    seconds: Option<f64>,
    /// After so many seconds without a pose the wearer counts as lost; the last pose is held
    #[arg(long, value_name = "N", default_value_t = 0.5, value_parser = seconds)]
    stale_after: f64,
    /// So many seconds after the first pose the wearer stands in the T-pose; take that as the sender's rest pose
    #[arg(long, value_name = "N", value_parser = seconds)]
    calibrate_after: Option<f64>,
    /// The sender's model, for its rest pose (VRM 1.0 senders send rotations that are not normalised)
    #[arg(long, value_name = "FILE.vrm", conflicts_with = "calibrate_after")]
    model: Option<PathBuf>,
    /// Smooth the poses; --record stores them as they were before
    #[arg(long)]
    filter: Option<FilterName>,
    /// Pose the wearer as she comes, even where the kimono would not let her
    #[arg(long)]
    as_recorded: bool,
    /// Write the poses as JSON Lines, as they came: before --filter, at the times of their receipt
    #[arg(long, value_name = "FILE.jsonl")]
    record: Option<PathBuf>,
    #[command(flatten)]
    places: Places,
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&seconds: &f64| seconds > 0.0 && seconds <= 1e6);
    number.ok_or_else(|| "seconds are a number above 0".to_owned())
}

/// Plays until the time is over; 1 when something cannot be read, written or listened to.
pub fn run(args: Args) -> ExitCode {
    ended(play(&args))
}

fn play(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let fit = |body: &String| wearers::fitted_to(&args.places, &pack, body, args.rules.as_deref());
    let fitted = args.body.as_ref().map(fit).transpose()?;
    let garment = fitted.as_ref().map_or(pack.garment(), |fitted| &fitted.garment);
    let skeleton = &garment.data().skeleton;
    let settings = Settings { address: args.vmc, source: args.source, ..Settings::default() };
    let mut listener = Listener::new(&settings, skeleton).map_err(|error| error.to_string())?;
    if let Some(model) = &args.model {
        let rest = vrma::read_rest(&shots::read(model)?).map_err(|error| format!("{}: {error}", model.display()))?;
        listener.receiver().set_rest(rest);
    }
    let mut recorder = args.record.as_deref().map(Recorder::new).transpose()?;
    let mut wearer = Wearer::new(garment, args.filter.map(FilterName::filter), args.as_recorded);
    // Warm caches, so that the first pose is not late.
    wearer.show(&Tracked::UNSEEN, Instant::now());
    let address = listener.address().map_err(|error| error.to_string())?;
    println!("{} listens at {address}", garment.data().id);
    let is_stopped = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&is_stopped);
    ctrlc::set_handler(move || stop.store(true, Ordering::Relaxed))
        .map_err(|error| format!("cannot wait for Ctrl-C: {error}"))?;
    let start = Instant::now();
    let end = args.seconds.map(|seconds| start + Duration::from_secs_f64(seconds));
    let (mut all, mut second) = (Figures::default(), Figures::default());
    let mut reported = (start, Counters::default());
    let mut first: Option<Instant> = None;
    let mut is_calibrated = args.calibrate_after.is_none();
    let mut unwritten = Ok(());
    loop {
        let now = Instant::now();
        let until = end.into_iter().chain([reported.0 + Duration::from_secs(1)]).min().unwrap_or(now);
        listener.wait(until.saturating_duration_since(now).min(STOPPED_WITHIN), |pose, came| {
            let began = *first.get_or_insert(came);
            if let (Some(recorder), Ok(())) = (&mut recorder, &unwritten) {
                unwritten = recorder.write((came - began).as_secs_f64(), pose);
            }
            let latency = wearer.show(pose, came);
            second.add(latency);
        });
        std::mem::replace(&mut unwritten, Ok(()))?;
        let now = Instant::now();
        if let (false, Some(began), Some(after_s)) = (is_calibrated, first, args.calibrate_after)
            && (now - began).as_secs_f64() >= after_s
        {
            is_calibrated = listener.receiver().calibrate();
            if is_calibrated {
                println!("calibrated: the sender's rest pose is the one of this moment");
            }
        }
        let is_over = is_stopped.load(Ordering::Relaxed) || end.is_some_and(|end| now >= end);
        if is_over || now - reported.0 >= Duration::from_secs(1) {
            let counters = listener.receiver().counters();
            let now_s = listener.now_s();
            let pose = listener.receiver().pose(now_s, args.stale_after);
            report(&second, &counters, &reported.1, now - reported.0, &pose, skeleton);
            all.join(std::mem::take(&mut second));
            reported = (now, counters);
        }
        if is_over {
            break;
        }
    }
    let Counters { datagrams, ignored, malformed, poses, missing_poses, lost_bones, .. } =
        listener.receiver().counters();
    if let (false, Some(after_s)) = (is_calibrated, args.calibrate_after) {
        let why = if first.is_some() { "play ended before" } else { "no pose came" };
        println!("not calibrated: {why}; --calibrate-after takes the pose {after_s} s after the first one");
    }
    println!("{}", all.summary());
    println!(
        "{} in {datagrams} datagrams; {} missing (lost, or never sent) and {lost_bones} bones; {malformed} malformed, \
         {ignored} ignored, {} from elsewhere",
        counted(poses),
        counted(missing_poses),
        listener.foreign_datagrams()
    );
    Ok(())
}

fn counted(poses: u64) -> String {
    if poses == 1 { "1 pose".to_owned() } else { format!("{poses} poses") }
}

/// A line of live figures.
fn report(second: &Figures, now: &Counters, before: &Counters, passed: Duration, pose: &Tracked, skeleton: &Skeleton) {
    let confidence = |joint: &kitsuke::skeleton::Joint| (joint.bone, pose.confidence[joint.bone as usize]);
    let confidences: Vec<(Bone, f32)> = skeleton.joints().iter().map(confidence).collect();
    let mean = confidences.iter().map(|(_, c)| c).sum::<f32>() / confidences.len() as f32;
    let doubtful: Vec<&str> = confidences.iter().filter(|(_, c)| *c < 0.5).map(|(bone, _)| bone.name()).collect();
    let who = match doubtful.len() {
        0 => String::new(),
        count if count == confidences.len() => " (wearer lost)".to_owned(),
        _ => format!(" (below 0.5: {})", doubtful.join(", ")),
    };
    let missing = now.missing_poses - before.missing_poses;
    println!(
        "{:5.1} fps  {}  missing {missing}  malformed {}  confidence {mean:.2}{who}",
        second.latencies_s.len() as f64 / passed.as_secs_f64(),
        second.latency(),
        now.malformed - before.malformed,
    );
    _ = std::io::stdout().flush();
}

/// The kimono on the wearer.
struct Wearer<'a> {
    garment: &'a Garment,
    scratch: Scratch,
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    filter: Option<(Filter, FilterState)>,
    as_recorded: bool,
    shown: Option<Instant>,
}

impl Wearer<'_> {
    fn new(garment: &Garment, filter: Option<Filter>, as_recorded: bool) -> Wearer<'_> {
        Wearer {
            garment,
            scratch: Scratch::new(garment),
            positions_m: vec![Vec3::ZERO; garment.vertex_count()],
            normals: vec![Vec3::ZERO; garment.vertex_count()],
            filter: filter.map(|filter| (filter, FilterState::default())),
            as_recorded,
            shown: None,
        }
    }

    /// Evaluates a pose; returns how long ago its last datagram was received.
    fn show(&mut self, pose: &Tracked, came: Instant) -> Duration {
        let passed_s = self.shown.map_or(0.0, |shown| came.saturating_duration_since(shown).as_secs_f64());
        self.shown = Some(came);
        let filtered = self.filter.as_mut().map(|(filter, state)| filter.apply(state, pose, passed_s));
        let pose = filtered.as_ref().unwrap_or(pose);
        let frame = Frame { positions_m: &mut self.positions_m, normals: &mut self.normals };
        if self.as_recorded {
            evaluate(self.garment, &pose.pose, &mut self.scratch, frame);
        } else {
            evaluate(self.garment, &self.garment.limited(&pose.pose).pose, &mut self.scratch, frame);
        }
        came.elapsed()
    }
}

/// The time from when a pose's last datagram is received to the finished cloth; how long it lay in the socket before is not seen.
#[derive(Default)]
struct Figures {
    latencies_s: Vec<f64>,
}

impl Figures {
    fn add(&mut self, latency: Duration) {
        self.latencies_s.push(latency.as_secs_f64());
    }

    fn join(&mut self, mut more: Figures) {
        self.latencies_s.append(&mut more.latencies_s);
    }

    /// The latency at this share of all, ms.
    fn at_ms(&self, share: f64) -> f64 {
        let mut sorted = self.latencies_s.clone();
        sorted.sort_by(f64::total_cmp);
        let index = (share * sorted.len() as f64) as usize;
        1e3 * sorted.get(index.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
    }

    fn latency(&self) -> String {
        format!("latency {:.2} ms (99 %: {:.2} ms)", self.at_ms(0.5), self.at_ms(0.99))
    }

    fn summary(&self) -> String {
        let within = |ms: f64| {
            let count = self.latencies_s.iter().filter(|&&latency_s| latency_s * 1e3 <= ms).count();
            100.0 * count as f64 / self.latencies_s.len().max(1) as f64
        };
        format!(
            "{} evaluated, latency from receipt of the datagram median {:.3} ms, 99 % {:.3} ms, max {:.3} ms; {:.2} % within a frame at 120 Hz",
            counted(self.latencies_s.len() as u64),
            self.at_ms(0.5),
            self.at_ms(0.99),
            self.at_ms(1.0),
            within(1e3 / 120.0)
        )
    }
}

/// Writes each pose as it comes, so that nothing is lost when the program is stopped.
struct Recorder {
    path: String,
    file: File,
}

impl Recorder {
    fn new(path: &std::path::Path) -> Result<Recorder, String> {
        let unwritten = |error| format!("cannot write {}: {error}", path.display());
        let mut file = File::create(path).map_err(unwritten)?;
        file.write_all(jsonl::header().as_bytes()).map_err(unwritten)?;
        Ok(Recorder { path: path.display().to_string(), file })
    }

    fn write(&mut self, time_s: f64, pose: &Tracked) -> Result<(), String> {
        let mut line = String::new();
        jsonl::write_frame(&mut line, time_s, pose);
        self.file.write_all(line.as_bytes()).map_err(|error| format!("cannot write {}: {error}", self.path))
    }
}
