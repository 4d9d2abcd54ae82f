//! Arrays as the buffer views and accessors of a glTF file: as they are, sparse, or meshopt-compressed. Knows no garment.

use serde_json::{Map, Value, json};

/// The extension by which buffer views are compressed.
pub const MESHOPT: &str = "EXT_meshopt_compression";

/// What an array is for, as far as the file wants to know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Attributes of vertices.
    Vertices,
    /// Corners of triangles.
    Corners,
    /// Keys of an animation, matrices.
    Other,
}

/// An array: rows of numbers, padded to a multiple of four bytes where it is of vertices.
#[derive(Clone, Debug)]
pub struct Array {
    /// Its rows, one after the other.
    pub bytes: Vec<u8>,
    /// Bytes of a row.
    pub stride: usize,
    /// glTF's number of the type.
    pub component: u32,
    /// `SCALAR`, `VEC3` …
    pub kind: &'static str,
    /// Whether integers stand for fractions.
    pub is_normalised: bool,
    /// What it is for.
    pub is_for: Use,
    /// Least and greatest of each component, where they must be said.
    pub bounds: Option<(Vec<f64>, Vec<f64>)>,
}

/// Numbers that a file can hold.
pub trait Component: Copy {
    /// glTF's number of the type.
    const NUMBER: u32;
    /// Adds its bytes.
    fn put(self, to: &mut Vec<u8>);
    /// As a number that JSON can hold.
    fn value(self) -> f64;
}

macro_rules! component {
    ($type:ty, $number:expr) => {
        impl Component for $type {
            const NUMBER: u32 = $number;
            fn put(self, to: &mut Vec<u8>) {
                to.extend(self.to_le_bytes());
            }
            fn value(self) -> f64 {
                self.into()
            }
        }
    };
}

component!(u8, 5121);
component!(i16, 5122);
component!(u16, 5123);
component!(u32, 5125);
component!(f32, 5126);

impl Array {
    /// Of rows.
    pub fn of<C: Component, const N: usize>(is_for: Use, rows: &[[C; N]]) -> Array {
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].get(N).copied().unwrap_or("MAT4");
        let mut array = Array {
            bytes: Vec::new(),
            stride: 0,
            component: C::NUMBER,
            kind,
            is_normalised: false,
            is_for,
            bounds: None,
        };
        array.stride = N * size_of::<C>();
        if is_for == Use::Vertices {
            array.stride = array.stride.next_multiple_of(4);
        }
        for row in rows {
            let end = array.bytes.len() + array.stride;
            row.iter().for_each(|number| number.put(&mut array.bytes));
            array.bytes.resize(end, 0);
        }
        array
    }

    /// Says the least and greatest of each component.
    pub fn bounded<C: Component, const N: usize>(mut self, rows: &[[C; N]]) -> Array {
        let fold = |start: f64, by: fn(f64, f64) -> f64| {
            (0..N).map(|i| rows.iter().fold(start, |found, row| by(found, row[i].value()))).collect()
        };
        self.bounds = Some((fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)));
        self
    }

    /// Integers that stand for fractions.
    pub fn normalised(mut self) -> Array {
        self.is_normalised = true;
        self
    }

    fn count(&self) -> usize {
        self.bytes.len() / self.stride.max(1)
    }

    fn accessor(&self, count: usize) -> Map<String, Value> {
        let mut accessor = Map::new();
        accessor.insert("componentType".into(), json!(self.component));
        accessor.insert("type".into(), json!(self.kind));
        accessor.insert("count".into(), json!(count));
        if self.is_normalised {
            accessor.insert("normalized".into(), json!(true));
        }
        if let Some((least, most)) = &self.bounds {
            accessor.insert("min".into(), json!(least));
            accessor.insert("max".into(), json!(most));
        }
        accessor
    }
}

/// A file's data, as it grows.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    /// Whether arrays are compressed.
    is_compressed: bool,
    /// What the file holds.
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    /// Bytes of what stands compressed in the file once it is decoded.
    decoded: usize,
}

impl Buffers {
    /// Nothing yet; arrays will be compressed or not.
    pub fn new(is_compressed: bool) -> Buffers {
        Buffers { is_compressed, ..Buffers::default() }
    }

    /// Adds bytes that nothing is known of; the number of their view.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.place(bytes);
        self.views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        self.views.len() - 1
    }

    /// Where bytes come to stand, at a multiple of four.
    fn place(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len().next_multiple_of(4);
        self.bytes.resize(offset, 0);
        self.bytes.extend(bytes);
        offset
    }

    /// Adds an array; the number of its accessor.
    pub fn array(&mut self, array: &Array) -> usize {
        let mut accessor = array.accessor(array.count());
        let view = self.view_of(array);
        accessor.insert("bufferView".into(), json!(view));
        self.accessors.push(Value::Object(accessor));
        self.accessors.len() - 1
    }

    fn view_of(&mut self, array: &Array) -> usize {
        let compressed = if self.is_compressed { compressed(array) } else { None };
        let mut view = match compressed {
            Some((mode, bytes)) => {
                let offset = self.place(&bytes);
                let extension = json!({
                    "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "byteStride": array.stride,
                    "count": array.count(), "mode": mode,
                });
                // Decoded arrays stand in a buffer that no file holds.
                let at = self.decoded.next_multiple_of(4);
                self.decoded = at + array.bytes.len();
                json!({ "buffer": 1, "byteOffset": at, "byteLength": array.bytes.len(), "extensions": { MESHOPT: extension } })
            }
            None => json!({ "buffer": 0, "byteOffset": self.place(&array.bytes), "byteLength": array.bytes.len() }),
        };
        match array.is_for {
            Use::Vertices => (view["byteStride"], view["target"]) = (json!(array.stride), json!(34962)),
            Use::Corners => view["target"] = json!(34963),
            Use::Other => {}
        }
        self.views.push(view);
        self.views.len() - 1
    }

    /// Adds rows of which most are 0: only the others are stored, if that is shorter.
    pub fn sparse(&mut self, rows: &[[f32; 3]]) -> usize {
        let whole = Array::of(Use::Vertices, rows).bounded(rows);
        let moved: Vec<usize> = (0..rows.len()).filter(|&row| rows[row] != [0.0; 3]).collect();
        if self.is_compressed || moved.is_empty() || 16 * moved.len() > 12 * rows.len() {
            return self.array(&whole);
        }
        let indices: Vec<u8> = moved.iter().flat_map(|&row| (row as u32).to_le_bytes()).collect();
        let values: Vec<u8> = moved.iter().flat_map(|&row| rows[row]).flat_map(f32::to_le_bytes).collect();
        let (indices, values) = (self.view(&indices), self.view(&values));
        let mut accessor = whole.accessor(rows.len());
        let sparse = json!({
            "count": moved.len(), "indices": { "bufferView": indices, "componentType": u32::NUMBER },
            "values": { "bufferView": values },
        });
        accessor.insert("sparse".into(), sparse);
        self.accessors.push(Value::Object(accessor));
        self.accessors.len() - 1
    }

    /// The file: its document, which learns of the data, and the data.
    pub fn glb(self, mut document: Value) -> Vec<u8> {
        let mut buffers = vec![json!({ "byteLength": self.bytes.len() })];
        if self.decoded > 0 {
            buffers.push(json!({ "byteLength": self.decoded, "extensions": { MESHOPT: { "fallback": true } } }));
        }
        document["buffers"] = json!(buffers);
        document["bufferViews"] = json!(self.views);
        document["accessors"] = json!(self.accessors);
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut data = self.bytes;
        data.resize(data.len().next_multiple_of(4), 0);
        let length = 28 + text.len() + data.len();
        let mut glb = b"glTF".to_vec();
        let words = [2, length as u32, text.len() as u32, u32::from_le_bytes(*b"JSON")];
        glb.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        glb.extend(text);
        glb.extend([data.len() as u32, u32::from_le_bytes(*b"BIN\0")].iter().flat_map(|word| word.to_le_bytes()));
        glb.extend(data);
        glb
    }
}

/// An array's mode and compressed bytes; none where its rows cannot be compressed. In the codec's version 0, which the extension names.
fn compressed(array: &Array) -> Option<(&'static str, Vec<u8>)> {
    fn rows<const N: usize>(bytes: &[u8]) -> Option<Vec<u8>> {
        meshopt::encode_vertex_buffer_level(bytes.as_chunks::<N>().0, 2, Some(0)).ok()
    }
    if array.bytes.is_empty() {
        return None;
    }
    if array.is_for == Use::Corners {
        let corners: Vec<u32> = match array.stride {
            2 => array.bytes.as_chunks::<2>().0.iter().map(|&corner| u16::from_le_bytes(corner).into()).collect(),
            _ => array.bytes.as_chunks::<4>().0.iter().map(|&corner| u32::from_le_bytes(corner)).collect(),
        };
        let most = corners.iter().copied().max().unwrap_or(0) as usize;
        return Some(("TRIANGLES", meshopt::encode_index_buffer(&corners, most + 1).ok()?));
    }
    let bytes = match array.stride {
        4 => rows::<4>(&array.bytes),
        8 => rows::<8>(&array.bytes),
        12 => rows::<12>(&array.bytes),
        16 => rows::<16>(&array.bytes),
        _ => None,
    }?;
    Some(("ATTRIBUTES", bytes))
}
