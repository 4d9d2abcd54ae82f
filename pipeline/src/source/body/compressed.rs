//! Buffer views of a glTF file that meshopt has compressed: taken out of its JSON, which then names a buffer of its own for each, and decoded into
//! these buffers. Checks what the JSON says of them. Knows neither the codecs nor what the views hold.

use super::meshopt::{Filter, Mode, decoded};
use gltf::buffer::Data;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// Names of the extension, which differ in nothing that a decoder must know.
const EXTENSIONS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
/// Most bytes of a file's views when decoded: twelve times what a garment's largest mesh has.
const MOST_BYTES: usize = 256 << 20;

/// The compressed views of a file.
#[derive(Default)]
pub(super) struct Compressed {
    views: Vec<View>,
    /// How many buffers the file itself has; those of the views come behind them.
    pub own_buffers: usize,
    /// Buffers of the file that only stand for what compressed views hold, and need not exist.
    pub stand_ins: BTreeSet<usize>,
}

struct View {
    /// Its number in the file.
    number: usize,
    /// Where the compressed bytes are.
    buffer: usize,
    offset: usize,
    length: usize,
    mode: Mode,
    filter: Filter,
    count: usize,
    stride: usize,
}

impl Compressed {
    /// Takes them out of a file's JSON.
    ///
    /// # Errors
    /// What the file says of a view contradicts itself, or the views would be larger than 256 MB.
    pub fn taken(root: &mut Map<String, Value>) -> Result<Compressed, String> {
        let own_buffers = list(root, "buffers").map_or(0, |buffers| buffers.len());
        let mut compressed = Compressed { own_buffers, ..Compressed::default() };
        let (mut bytes, mut plain) = (0, BTreeSet::new());
        for (number, view) in list(root, "bufferViews").into_iter().flatten().enumerate() {
            let Some(view) = view.as_object_mut() else { continue };
            let whole = |name: &str| view.get(name).and_then(Value::as_u64).map(|buffer| buffer as usize);
            let (buffer, length, stride) = (whole("buffer"), whole("byteLength"), whole("byteStride"));
            let extensions = view.remove("extensions");
            let own = extensions.as_ref().and_then(|all| EXTENSIONS.iter().find_map(|name| all.get(name)));
            let Some(own) = own else {
                plain.extend(buffer);
                continue;
            };
            let fault = |problem: &str| format!("buffer view {number} is compressed (meshopt), but {problem}");
            let own = described(number, own).map_err(|problem| fault(&problem))?;
            let decoded_length = own.count.checked_mul(own.stride).ok_or_else(|| fault("its size is no number"))?;
            if length != Some(decoded_length) || stride.is_some_and(|stride| stride != own.stride) {
                let said =
                    format!("its byteLength or byteStride is not that of {} rows of {} bytes", own.count, own.stride);
                return Err(fault(&said));
            }
            bytes += decoded_length.min(MOST_BYTES + 1);
            if bytes > MOST_BYTES {
                return Err(format!("its compressed buffer views hold more than {} MB", MOST_BYTES >> 20));
            }
            compressed.stand_ins.extend(buffer);
            plain.insert(own.buffer);
            view.insert("buffer".to_owned(), json!(compressed.own_buffers + compressed.views.len()));
            view.insert("byteOffset".to_owned(), json!(0));
            compressed.views.push(own);
        }
        compressed.stand_ins.retain(|buffer| !plain.contains(buffer));
        if let Some(buffers) = list(root, "buffers") {
            buffers.extend(compressed.views.iter().map(|view| json!({ "byteLength": view.count * view.stride })));
        }
        Ok(compressed)
    }

    /// The bytes of the views, for the buffers behind the file's own.
    ///
    /// # Errors
    /// A view reaches beyond its buffer, or its bytes are damaged.
    pub fn decoded(&self, buffers: &[Data]) -> Result<Vec<Data>, String> {
        let of_view = |view: &View| {
            let bytes = buffers.get(view.buffer).and_then(|buffer| buffer.get(view.offset..)?.get(..view.length));
            bytes
                .ok_or("it reaches beyond its buffer")
                .and_then(|bytes| decoded(bytes, view.mode, view.filter, view.count, view.stride))
                .map(Data)
                .map_err(|problem| format!("buffer view {} cannot be decompressed (meshopt): {problem}", view.number))
        };
        self.views.iter().map(of_view).collect()
    }
}

/// A view as the extension describes it.
fn described(number: usize, own: &Value) -> Result<View, String> {
    let whole = |name: &str| match own.get(name).and_then(Value::as_u64) {
        Some(value) => Ok(value as usize),
        None => Err(format!("its {name} is no whole number")),
    };
    let mode = match own.get("mode").and_then(Value::as_str) {
        Some("ATTRIBUTES") => Mode::Attributes,
        Some("TRIANGLES") => Mode::Triangles,
        Some("INDICES") => Mode::Indices,
        _ => return Err("its mode is none of ATTRIBUTES, TRIANGLES and INDICES".to_owned()),
    };
    let filter = match own.get("filter").map(Value::as_str) {
        None | Some(Some("NONE")) => Filter::None,
        Some(Some("OCTAHEDRAL")) => Filter::Octahedral,
        Some(Some("QUATERNION")) => Filter::Quaternion,
        Some(Some("EXPONENTIAL")) => Filter::Exponential,
        Some(Some("COLOR")) => Filter::Colour,
        _ => return Err("its filter is none of NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL and COLOR".to_owned()),
    };
    let offset = if own.get("byteOffset").is_some() { whole("byteOffset")? } else { 0 };
    let (buffer, length) = (whole("buffer")?, whole("byteLength")?);
    Ok(View { number, buffer, offset, length, mode, filter, count: whole("count")?, stride: whole("byteStride")? })
}

fn list<'a>(root: &'a mut Map<String, Value>, name: &str) -> Option<&'a mut Vec<Value>> {
    root.get_mut(name)?.as_array_mut()
}
