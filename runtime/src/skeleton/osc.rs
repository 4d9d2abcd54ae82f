//! Open Sound Control datagrams to messages, for packets that nobody vouches for: no recursion, no allocation, nothing beyond
//! the datagram read. Knows no address.
//!
//! Malformed parts end the reading of their bundle; what came before them counts.

/// Longest datagram that is read, bytes.
pub const LONGEST_DATAGRAM: usize = 8192;
/// How many bundles may lie in one another.
pub const DEPTH: usize = 2;
/// Most messages of a datagram.
pub const MOST_MESSAGES: usize = 256;

/// A message: an address and typed arguments, all borrowed from the datagram.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message<'a> {
    /// For example `/VMC/Ext/OK`.
    pub address: &'a str,
    tags: &'a [u8],
    data: &'a [u8],
}

/// An argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument<'a> {
    /// `i`
    Int(i32),
    /// `f`; may be any bits.
    Float(f32),
    /// `s`, UTF-8.
    Text(&'a str),
    /// Of another type, skipped.
    Other,
}

/// What a datagram holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part<'a> {
    /// A message.
    Message(Message<'a>),
    /// Bytes that are no message, a bundle too deep, or more messages than allowed; the rest of its bundle is not read.
    Malformed,
}

/// The messages of a datagram, in order, bundles opened.
#[must_use]
pub fn parts(datagram: &[u8]) -> Parts<'_> {
    let whole = if datagram.len() <= LONGEST_DATAGRAM { Some(datagram) } else { None };
    Parts { whole, too_long: whole.is_none(), open: [&[]; DEPTH], depth: 0, messages: 0 }
}

/// Iterator of [`parts`].
#[derive(Clone, Debug)]
pub struct Parts<'a> {
    whole: Option<&'a [u8]>,
    too_long: bool,
    /// What is left of each open bundle, the outermost first.
    open: [&'a [u8]; DEPTH],
    depth: usize,
    messages: usize,
}

impl<'a> Iterator for Parts<'a> {
    type Item = Part<'a>;

    fn next(&mut self) -> Option<Part<'a>> {
        if std::mem::take(&mut self.too_long) {
            return Some(Part::Malformed);
        }
        loop {
            let element = match self.whole.take() {
                Some(whole) => whole,
                None => {
                    let rest = self.open.get_mut(self.depth.checked_sub(1)?)?;
                    if rest.is_empty() {
                        self.depth -= 1;
                        continue;
                    }
                    let Some(element) = take_sized(rest) else {
                        *rest = &[];
                        return Some(Part::Malformed);
                    };
                    element
                }
            };
            if let Some(bundle) = element.strip_prefix(b"#bundle\0") {
                // The time tag is not used.
                match (bundle.get(8..), self.open.get_mut(self.depth)) {
                    (Some(elements), Some(slot)) => {
                        *slot = elements;
                        self.depth += 1;
                        continue;
                    }
                    _ => return Some(Part::Malformed),
                }
            }
            self.messages += 1;
            if self.messages > MOST_MESSAGES {
                self.depth = 0;
                return Some(Part::Malformed);
            }
            return Some(message(element).map_or(Part::Malformed, Part::Message));
        }
    }
}

/// An element of a bundle: its length, a multiple of 4 above 0, then so many bytes.
fn take_sized<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_first_chunk::<4>()?;
    let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
    if length == 0 || !length.is_multiple_of(4) || length > after.len() {
        return None;
    }
    let (element, after) = after.split_at(length);
    *rest = after;
    Some(element)
}

fn message(element: &[u8]) -> Option<Message<'_>> {
    let mut rest = element;
    let address = take_text(&mut rest)?;
    if !address.starts_with('/') {
        return None;
    }
    if rest.is_empty() {
        // Old senders leave the types out where there are no arguments.
        return Some(Message { address, tags: &[], data: &[] });
    }
    let tags = take_text(&mut rest)?.strip_prefix(',')?;
    Some(Message { address, tags: tags.as_bytes(), data: rest })
}

/// Text up to a zero byte, padded with zeros to a multiple of 4.
fn take_text<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let length = rest.iter().position(|&byte| byte == 0)?;
    let padded = (length / 4 + 1) * 4;
    let text = std::str::from_utf8(&rest[..length]).ok()?;
    *rest = rest.get(padded..)?;
    Some(text)
}

impl<'a> Message<'a> {
    /// The first `N` arguments; `None` where there are fewer, or their bytes are not all there. What follows them is not
    /// looked at.
    #[must_use]
    pub fn arguments<const N: usize>(&self) -> Option<[Argument<'a>; N]> {
        let mut data = self.data;
        let mut arguments = [Argument::Other; N];
        for (argument, &tag) in arguments.iter_mut().zip(self.tags.get(..N)?) {
            *argument = take_argument(tag, &mut data)?;
        }
        Some(arguments)
    }

    /// How many arguments the types announce.
    #[must_use]
    pub fn argument_count(&self) -> usize {
        self.tags.len()
    }
}

fn take_argument<'a>(tag: u8, data: &mut &'a [u8]) -> Option<Argument<'a>> {
    let mut four = || {
        let (bytes, rest) = data.split_first_chunk::<4>()?;
        *data = rest;
        Some(*bytes)
    };
    match tag {
        b'i' => four().map(|bytes| Argument::Int(i32::from_be_bytes(bytes))),
        b'f' => four().map(|bytes| Argument::Float(f32::from_be_bytes(bytes))),
        b's' | b'S' => take_text(data).map(Argument::Text),
        b'c' | b'r' | b'm' => four().map(|_| Argument::Other),
        b'h' | b't' | b'd' => four().and_then(|_| four()).map(|_| Argument::Other),
        b'T' | b'F' | b'N' | b'I' => Some(Argument::Other),
        b'b' => {
            let length = usize::try_from(u32::from_be_bytes(four()?)).ok()?;
            *data = data.get(length.checked_next_multiple_of(4)?..)?;
            Some(Argument::Other)
        }
        _ => None,
    }
}

/// Appends a message to a datagram.
///
/// # Panics
/// When a text holds a zero byte.
pub fn write_message(out: &mut Vec<u8>, address: &str, arguments: &[Argument<'_>]) {
    write_text(out, address);
    let tag = |argument: &Argument<'_>| match argument {
        Argument::Int(_) => 'i',
        Argument::Float(_) => 'f',
        Argument::Text(_) => 's',
        Argument::Other => 'N',
    };
    write_text(out, &std::iter::once(',').chain(arguments.iter().map(tag)).collect::<String>());
    for argument in arguments {
        match argument {
            Argument::Int(number) => out.extend(number.to_be_bytes()),
            Argument::Float(number) => out.extend(number.to_be_bytes()),
            Argument::Text(text) => write_text(out, text),
            Argument::Other => {}
        }
    }
}

/// Appends the head of a bundle that is to be used at once.
pub fn write_bundle_head(out: &mut Vec<u8>) {
    out.extend(b"#bundle\0");
    out.extend(1_u64.to_be_bytes());
}

/// Appends a message as an element of a bundle.
///
/// # Panics
/// When a text holds a zero byte.
pub fn write_element(out: &mut Vec<u8>, address: &str, arguments: &[Argument<'_>]) {
    let at = out.len();
    out.extend([0; 4]);
    write_message(out, address, arguments);
    let length = u32::try_from(out.len() - at - 4).expect("a message is short");
    out[at..at + 4].copy_from_slice(&length.to_be_bytes());
}

fn write_text(out: &mut Vec<u8>, text: &str) {
    assert!(!text.bytes().any(|byte| byte == 0), "OSC texts end with a zero byte");
    out.extend(text.as_bytes());
    out.resize(out.len() + 4 - text.len() % 4, 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    const T: Argument<'_> = Argument::Float(1.5);

    fn bundle(elements: &[&[u8]]) -> Vec<u8> {
        let mut out = Vec::new();
        write_bundle_head(&mut out);
        for element in elements {
            out.extend((element.len() as u32).to_be_bytes());
            out.extend(*element);
        }
        out
    }

    fn message_bytes(address: &str, arguments: &[Argument<'_>]) -> Vec<u8> {
        let mut out = Vec::new();
        write_message(&mut out, address, arguments);
        out
    }

    fn addresses(datagram: &[u8]) -> Vec<&str> {
        let name = |part| if let Part::Message(message) = part { message.address } else { "malformed" };
        parts(datagram).map(name).collect()
    }

    #[test]
    fn what_is_written_is_read() {
        let arguments = [Argument::Text("左手"), Argument::Int(-3), T, Argument::Other];
        let bytes = message_bytes("/a/bc", &arguments);
        let [Part::Message(message)] = parts(&bytes).collect::<Vec<_>>()[..] else { panic!("one message") };
        assert_eq!(message.arguments::<4>(), Some(arguments));
        assert_eq!(message.arguments::<2>(), Some([arguments[0], arguments[1]]));
        assert_eq!((message.arguments::<5>(), message.argument_count()), (None, 4));
    }

    #[test]
    fn bundles_open_two_deep_and_faults_stay_in_their_bundle() {
        let [a, b, c] = ["/a", "/b", "/c"].map(|address| message_bytes(address, &[T]));
        let inner = bundle(&[&b]);
        assert_eq!(addresses(&bundle(&[&a, &inner, &c])), ["/a", "/b", "/c"]);
        assert_eq!(addresses(&bundle(&[&a, &bundle(&[&inner]), &c])), ["/a", "malformed", "/c"]);
        let mut cut = bundle(&[&a, &b]);
        cut.pop();
        assert_eq!(addresses(&cut), ["/a", "malformed"]);
        assert_eq!(addresses(&bundle(&[&a, b"nope", &c])), ["/a", "malformed", "/c"]);
        assert_eq!(addresses(&bundle(&[])), [""; 0]);
        assert_eq!(addresses(b""), ["malformed"]);
        assert_eq!(addresses(&vec![b'/'; LONGEST_DATAGRAM + 4]), ["malformed"]);
        let many = vec![a.as_slice(); MOST_MESSAGES + 9];
        assert_eq!(addresses(&bundle(&many)).len(), MOST_MESSAGES + 1);
    }

    #[test]
    fn arguments_that_are_not_there_are_not_read() {
        let head = message_bytes("/a", &[]);
        for (tags, data, expected) in [
            (",f\0\0", &[0, 0, 0][..], None),
            (",b\0\0", &[0xff, 0xff, 0xff, 0xff], None),
            (",b\0\0", &[0, 0, 0, 2, 1, 2, 0, 0], Some(Argument::Other)),
            (",s\0\0", b"abcd", None),
            (",[\0\0", &[0; 8], None),
            (",h\0\0", &[0; 8], Some(Argument::Other)),
            (",h\0\0", &[0; 7], None),
        ] {
            let bytes = [&head[..4], tags.as_bytes(), data].concat();
            let Some(Part::Message(message)) = parts(&bytes).next() else { panic!("{tags} is a message") };
            assert_eq!(message.arguments::<1>().map(|[argument]| argument), expected, "{tags:?} {data:?}");
        }
    }
}
