//! `cargo xtask replay`: a recorded motion becomes a live one.

use crate::places::{Places, ended};
use crate::shots;
use kitsuke::skeleton::vmc;
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Send a recorded motion in the VMC protocol, at its own pace
#[derive(clap::Args)]
pub struct Args {
    /// BVH, .vrma, MediaPipe or DeepMimic JSON, Kinect CSV, or JSON Lines
    #[arg(value_name = "FILE")]
    motion: PathBuf,
    /// Where to send
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = kitsuke_live::address, default_value_t = kitsuke_live::DEFAULT_ADDRESS)]
    vmc: SocketAddr,
    /// The kimono whose wearer moves: an ID, or the path of a pack
    #[arg(long, value_name = "ID", default_value = "komon")]
    garment: String,
    /// How often
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    times: u32,
    #[command(flatten)]
    read_as: shots::ReadAs,
    #[command(flatten)]
    places: Places,
}

/// Sends all frames; 1 when something cannot be read or sent.
pub fn run(args: Args) -> ExitCode {
    ended(replay(&args))
}

fn replay(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let wearer = &pack.garment().data().skeleton;
    let recording = shots::recording(&args.motion, wearer, args.read_as)?;
    let own: SocketAddr = if args.vmc.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0_u16; 8], 0).into() };
    let unsent = |error| format!("cannot send to {}: {error}", args.vmc);
    let socket = UdpSocket::bind(own).map_err(unsent)?;
    let last_s = recording.times_s.last().copied().unwrap_or(0.0);
    let frame_time_s = last_s / (recording.times_s.len() - 1).max(1) as f64;
    let round_s = last_s + frame_time_s;
    let start = Instant::now();
    for round in 0..args.times {
        for (time_s, frame) in recording.times_s.iter().zip(&recording.frames) {
            let due_s = f64::from(round) * round_s + time_s;
            std::thread::sleep(Duration::from_secs_f64(due_s).saturating_sub(start.elapsed()));
            for datagram in vmc::datagrams(&frame.pose, wearer, due_s as f32) {
                // Nobody listens yet, or no longer: the motion goes on all the same.
                match socket.send_to(&datagram, args.vmc) {
                    Err(error) if error.kind() != std::io::ErrorKind::ConnectionRefused => return Err(unsent(error)),
                    _ => {}
                }
            }
        }
    }
    let poses = u64::from(args.times) * recording.frames.len() as u64;
    println!("{poses} poses in {:.2} s to {}", start.elapsed().as_secs_f64(), args.vmc);
    Ok(())
}
