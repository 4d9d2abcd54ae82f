//! # kitsuke-live: the socket between VMC senders and kitsuke
//!
//! The one place that touches a network. It hands datagrams to [`kitsuke::skeleton::vmc::Receiver`], which knows no socket.
//! It starts no thread: [`Listener::wait`] blocks for as long as it is told to.

use kitsuke::skeleton::osc::LONGEST_DATAGRAM;
use kitsuke::skeleton::vmc::Receiver;
use kitsuke::skeleton::{Skeleton, Tracked};
use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::time::{Duration, Instant};

/// Where VMC performers send, and only from this machine.
pub const DEFAULT_ADDRESS: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 39539);

/// How to listen.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Address and port to listen at. Anyone who reaches it can move the wearer, so it is the loopback unless told otherwise.
    pub address: SocketAddr,
    /// Only datagrams from here count.
    pub source: Option<IpAddr>,
    /// Most datagrams of one [`Listener::wait`]; what comes beyond waits in the socket, where the system drops it at last.
    pub datagram_budget: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { address: DEFAULT_ADDRESS, source: None, datagram_budget: 64 }
    }
}

/// An address to listen at or to send to, as people write it: `127.0.0.1:39540`, `localhost:39540`, or a port alone for this
/// machine's loopback. Of a name's addresses the first of IPv4 counts, which VMC senders use.
///
/// # Errors
/// What is wrong with it, with an example.
pub fn address(text: &str) -> Result<SocketAddr, String> {
    let text = text.trim();
    if let Ok(port) = text.parse() {
        return Ok(SocketAddr::new(DEFAULT_ADDRESS.ip(), port));
    }
    let example = "write address and port, for example 127.0.0.1:39540, or a port alone";
    let has_port = text.rsplit_once(':').is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok());
    if !has_port {
        return Err(format!("there is no port from 0 to 65535 behind a colon; {example}"));
    }
    let found: Vec<SocketAddr> = text.to_socket_addrs().map_err(|error| format!("{error}; {example}"))?.collect();
    let first = found.iter().find(|address| address.is_ipv4()).or(found.first());
    first.copied().ok_or_else(|| format!("the name has no address; {example}"))
}

/// Why there is no listening.
#[derive(Debug, thiserror::Error)]
#[error("cannot listen at {address}: {error}; {}", self.remedy())]
pub struct ListenError {
    address: SocketAddr,
    error: std::io::Error,
}

impl ListenError {
    fn remedy(&self) -> &'static str {
        match self.error.kind() {
            ErrorKind::AddrInUse => "another program uses the port: end it, or listen at another port",
            ErrorKind::AddrNotAvailable => {
                "this machine has no such address: give one of its own, 127.0.0.1 for senders on this machine, or 0.0.0.0 for \
                 every network; a sender is chosen by its own address (source)"
            }
            ErrorKind::PermissionDenied => "ports below 1024 need rights: choose a higher one",
            _ => "try another address or port",
        }
    }
}

/// A socket and the receiver behind it.
#[derive(Debug)]
pub struct Listener {
    socket: UdpSocket,
    source: Option<IpAddr>,
    datagram_budget: usize,
    receiver: Receiver,
    start: Instant,
    foreign_datagrams: u64,
    /// One byte more than is read, so that a longer datagram is seen to be one.
    buffer: Box<[u8; LONGEST_DATAGRAM + 1]>,
}

impl Listener {
    /// Listens for poses of this wearer.
    ///
    /// # Errors
    /// When the address cannot be had.
    pub fn new(settings: &Settings, wearer: &Skeleton) -> Result<Listener, ListenError> {
        let failed = |error| ListenError { address: settings.address, error };
        let socket = UdpSocket::bind(settings.address).map_err(failed)?;
        Ok(Listener {
            socket,
            source: settings.source,
            datagram_budget: settings.datagram_budget.max(1),
            receiver: Receiver::new(wearer),
            start: Instant::now(),
            foreign_datagrams: 0,
            buffer: Box::new([0; LONGEST_DATAGRAM + 1]),
        })
    }

    /// The address listened at, with the port that the system chose where 0 was asked for.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn address(&self) -> std::io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Waits for at most this long, hands on every pose that becomes whole with the moment its last datagram was received, and
    /// returns as soon as no datagram is left. A datagram that cannot be read is as good as lost.
    pub fn wait(&mut self, longest: Duration, mut complete: impl FnMut(&Tracked, Instant)) {
        // A time-out of zero would mean none.
        let longest = longest.max(Duration::from_micros(1));
        let mut is_first = true;
        for _ in 0..self.datagram_budget {
            let configured = if is_first {
                self.socket.set_nonblocking(false).and_then(|()| self.socket.set_read_timeout(Some(longest)))
            } else {
                self.socket.set_nonblocking(true)
            };
            let received = configured.and_then(|()| self.socket.recv_from(self.buffer.as_mut_slice()));
            let came = Instant::now();
            match received {
                Ok((_, from)) if self.source.is_some_and(|source| source != from.ip()) => self.foreign_datagrams += 1,
                Ok((length, _)) => {
                    let now_s = came.duration_since(self.start).as_secs_f64();
                    self.receiver.datagram(&self.buffer[..length], now_s, |pose| complete(pose, came));
                }
                Err(error) if error.kind() == ErrorKind::Interrupted && is_first => return,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return,
                // An answer to something this machine sent, or a datagram too long for the system.
                Err(_) => {}
            }
            is_first = false;
        }
    }

    /// The receiver, to calibrate it and to read its counters.
    pub fn receiver(&mut self) -> &mut Receiver {
        &mut self.receiver
    }

    /// Seconds since listening began, the clock of the receiver.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Datagrams that came from elsewhere than [`Settings::source`].
    #[must_use]
    pub fn foreign_datagrams(&self) -> u64 {
        self.foreign_datagrams
    }
}
