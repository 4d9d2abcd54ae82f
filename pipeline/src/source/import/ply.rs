//! PLY, as scanners write it: text or binary of either byte order, with colours and texture coordinates of vertices or of corners. The
//! library takes the lines and bytes apart; what it takes on trust (counts, names that stand twice) is checked before.

use super::assembly::{Assembly, TRIANGLES, VERTICES};
use super::{Fault, ImportedMesh, Picture, text};
use glam::{DVec3, Vec2};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};
use ply_rs_bw::ply::{KeyMap, PropertyDef, ScalarType};

/// Longest header, bytes.
const LONGEST_HEADER: usize = 1 << 20;
/// What to do about a file that is broken.
const EXPORT: &str =
    "Export the scan again as PLY with vertices x, y, z and faces vertex_indices; every number must be finite.";
/// Names that programs give to one property.
const TEXTURE_U: [&str; 4] = ["s", "u", "texture_u", "texture_s"];
const TEXTURE_V: [&str; 4] = ["t", "v", "texture_v", "texture_t"];
const INDICES: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads a mesh.
pub(super) fn read(bytes: &[u8], warnings: &mut Vec<Fault>) -> Result<ImportedMesh, Fault> {
    let fault = |problem: String| Fault::new("mesh-ply", problem, EXPORT);
    let (header_bytes, payload) = split(bytes).map_err(fault)?;
    // Comments of another encoding (names of pictures) must not stop the library, which wants UTF-8.
    let header = header(&String::from_utf8_lossy(header_bytes)).map_err(fault)?;
    check(&header, payload.len()).map_err(fault)?;
    let numbers;
    let payload = match header.encoding {
        Encoding::Ascii => {
            numbers = plain_numbers(payload);
            &*numbers
        }
        _ => payload,
    };
    let mut reader = Reader::new(payload);
    let mut assembly = Assembly::default();
    let mut textured: Vec<Vec2> = Vec::new();
    let header_lines = header_bytes.iter().filter(|&&byte| byte == b'\n').count();
    for (name, element) in &header.elements {
        let unread = |error: ply_rs_bw::parser::ParseError| fault(unreadable(&error, header_lines));
        match name.as_str() {
            "vertex" => {
                let rows = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                let has = |names: &[&str]| names.iter().any(|name| element.properties.contains_key(*name));
                let is_coloured = has(&["red", "diffuse_red", "r"]);
                let is_textured = has(&TEXTURE_U) && has(&TEXTURE_V);
                for (number, row) in rows.map_err(unread)?.into_iter().enumerate() {
                    let place = DVec3::from_array(row.place);
                    let colour = is_coloured.then_some(row.colour);
                    assembly.position(place, colour, || format!("vertex {number}")).map_err(fault)?;
                    if is_textured {
                        textured.push(Vec2::from_array(row.uv));
                    }
                }
            }
            "face" | "tristrips" => {
                let part = assembly.part("default", "").map_err(fault)?;
                let rows = Parser::<Polygon>::new().read_payload_for_element(&mut reader, element, &header);
                for (number, row) in rows.map_err(unread)?.into_iter().enumerate() {
                    let naming = || format!("{name} {number}");
                    for corners in row.polygons(name == "tristrips").map_err(|index| {
                        fault(format!(
                            "{name} {number} names vertex {index}, but there are {}",
                            assembly.position_count()
                        ))
                    })? {
                        let own: Vec<Vec2> = row.uv.as_chunks::<2>().0.iter().map(|uv| Vec2::from_array(*uv)).collect();
                        let of_vertex = |&corner: &u32| textured.get(corner as usize).copied();
                        let of_vertices: Option<Vec<Vec2>> = corners.iter().map(of_vertex).collect();
                        let uv = if own.len() == corners.len() { Some(own) } else { of_vertices };
                        assembly.polygon(&corners, uv.as_deref(), part, naming).map_err(fault)?;
                    }
                }
            }
            _ => {
                let rows = Parser::<Other>::new().read_payload_for_element(&mut reader, element, &header);
                rows.map_err(unread)?;
            }
        }
    }
    super::note_skipped(&assembly, warnings);
    let mut mesh = assembly.finish();
    mesh.texture = texture(header_bytes).map(Picture::Named);
    Ok(mesh)
}

/// The header with its last line end, and what follows.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let start = &bytes[..bytes.len().min(LONGEST_HEADER)];
    let mut at = 0;
    while at < start.len() {
        let Some(length) = start[at..].iter().position(|&byte| byte == b'\n') else { break };
        let line = &start[at..at + length];
        at += length + 1;
        if line.trim_ascii() == b"end_header" {
            return Ok(bytes.split_at(at));
        }
    }
    Err("the header has no end (a line `end_header`); its lines must end in LF or CRLF".to_owned())
}

fn header(text: &str) -> Result<Header, String> {
    // Words that no reader needs, but some programs write.
    let is_known = |line: &&str| !line.trim().is_empty();
    let lines: Vec<&str> = text.lines().filter(is_known).map(str::trim_end).collect();
    let header = Parser::<Other>::new().read_header(&mut Reader::new(format!("{}\n", lines.join("\n")).as_bytes()));
    let header = header.map_err(|error| {
        let said = error.to_string();
        format!("the header cannot be read: {}", said.replace("\n\t", " "))
    })?;
    let count = |word: &str| lines.iter().filter(|line| line.split_whitespace().next() == Some(word)).count();
    // The library keeps the last of those of one name, and would take all that follows for something else.
    let properties: usize = header.elements.values().map(|element| element.properties.len()).sum();
    if count("element") != header.elements.len() || count("property") != properties {
        return Err("two elements, or two properties of one element, have one name".to_owned());
    }
    Ok(header)
}

/// A text with `.5` and `1.` as `0.5` and `1.0`, and without empty lines: the library knows neither.
fn plain_numbers(text: &[u8]) -> Vec<u8> {
    let mut plain = Vec::with_capacity(text.len() + 16);
    for line in text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty()) {
        for (at, &byte) in line.iter().enumerate() {
            let is_digit = |at: Option<usize>| at.and_then(|at| line.get(at)).is_some_and(u8::is_ascii_digit);
            if byte != b'.' {
                plain.push(byte);
                continue;
            }
            if !is_digit(at.checked_sub(1)) {
                plain.push(b'0');
            }
            plain.push(b'.');
            if !is_digit(Some(at + 1)) {
                plain.push(b'0');
            }
        }
        plain.push(b'\n');
    }
    plain
}

/// Holds what the header promises against the length of what follows, before anything is made room for.
fn check(header: &Header, payload: usize) -> Result<(), String> {
    let mut least = 0_u128;
    for (name, element) in &header.elements {
        let row: usize = match header.encoding {
            Encoding::Ascii => element.properties.len().max(1) * 2 - 1,
            _ => element.properties.values().map(least_bytes).sum(),
        };
        if row == 0 && element.count > 0 {
            return Err(format!("element {name} has no properties"));
        }
        least += element.count as u128 * row as u128;
        if least > payload as u128 {
            return Err(format!("the header promises {} of {name}, more than the file has bytes for", element.count));
        }
        let most = if name == "vertex" { VERTICES } else { TRIANGLES };
        if element.count > most {
            return Err(format!("the file has {} of {name}; at most {most} are read", element.count));
        }
    }
    let has = |element: &ElementDef, name: &str| element.properties.contains_key(name);
    let Some(vertex) = header.elements.get("vertex") else { return Err("the file has no element vertex".to_owned()) };
    if let Some(name) = ["x", "y", "z"].into_iter().find(|name| !has(vertex, name)) {
        return Err(format!("the vertices have no property {name}"));
    }
    let order: Vec<&str> = header.elements.keys().map(String::as_str).collect();
    let place = |name: &str| order.iter().position(|other| *other == name);
    for name in ["face", "tristrips"] {
        let Some(faces) = header.elements.get(name).filter(|faces| faces.count > 0) else { continue };
        if place(name) < place("vertex") {
            return Err(format!("element {name} stands before the vertices"));
        }
        let is_list = |name: &&str| {
            matches!(faces.properties.get(*name), Some(PropertyDef { data_type: PropertyType::List(..), .. }))
        };
        if !INDICES.iter().any(is_list) {
            return Err(format!("element {name} has no list vertex_indices"));
        }
    }
    let scalars: &KeyMap<PropertyDef> = &vertex.properties;
    match scalars.values().find(|property| matches!(property.data_type, PropertyType::List(..))) {
        Some(property) => Err(format!("property {} of the vertices is a list", property.name)),
        None => Ok(()),
    }
}

/// How many bytes a property takes at least.
fn least_bytes(property: &PropertyDef) -> usize {
    let bytes = |scalar: &ScalarType| match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    match &property.data_type {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => bytes(scalar),
    }
}

/// The library's message in one line, with the line of the file.
fn unreadable(error: &ply_rs_bw::parser::ParseError, header_lines: usize) -> String {
    let said = error.to_string();
    let said = said.split_once(": ").filter(|_| error.line().is_some()).map_or(&*said, |(_, said)| said);
    let said: Vec<&str> = said.split_whitespace().collect();
    let said: String = said.join(" ").chars().take(200).collect();
    match error.line() {
        Some(line) => format!("in line {} of the file: {said}", line + header_lines),
        None => format!("the numbers cannot be read: {said}"),
    }
}

/// The picture that a comment names, as MeshLab and others write it.
fn texture(header: &[u8]) -> Option<String> {
    let words = |line: &[u8]| line.strip_prefix(b"comment".as_slice()).map(|rest| rest.trim_ascii().to_vec());
    let name = |comment: Vec<u8>| {
        let rest = comment.get(b"TextureFile".len()..)?;
        let is_named = comment[..b"TextureFile".len()].eq_ignore_ascii_case(b"TextureFile");
        is_named.then(|| text(rest.trim_ascii()))
    };
    header.split(|&byte| byte == b'\n').filter_map(words).filter_map(name).find(|name| !name.is_empty())
}

/// A number of a property, whatever its type.
fn number(property: &Property) -> Option<f64> {
    Some(match property {
        Property::Char(n) => f64::from(*n),
        Property::UChar(n) => f64::from(*n),
        Property::Short(n) => f64::from(*n),
        Property::UShort(n) => f64::from(*n),
        Property::Int(n) => f64::from(*n),
        Property::UInt(n) => f64::from(*n),
        Property::Float(n) => f64::from(*n),
        Property::Double(n) => *n,
        _ => return None,
    })
}

/// A row of `vertex`.
struct Vertex {
    place: [f64; 3],
    uv: [f32; 2],
    colour: [u8; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Vertex {
        Vertex { place: [0.0; 3], uv: [0.0; 2], colour: [255; 3] }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(number) = number(&property) else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.place[0] = number,
            "y" => self.place[1] = number,
            "z" => self.place[2] = number,
            "red" | "diffuse_red" | "r" => self.colour[0] = colour(&property, number),
            "green" | "diffuse_green" | "g" => self.colour[1] = colour(&property, number),
            "blue" | "diffuse_blue" | "b" => self.colour[2] = colour(&property, number),
            name if TEXTURE_U.contains(&name) => self.uv[0] = number as f32,
            name if TEXTURE_V.contains(&name) => self.uv[1] = number as f32,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

/// A channel in 8 bits: floats are shares of 1, longer whole numbers shares of their largest.
fn colour(property: &Property, number: f64) -> u8 {
    let share = match property {
        Property::Float(_) | Property::Double(_) => number,
        Property::UShort(_) => number / 65535.0,
        _ => number / 255.0,
    };
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// A row of `face` or `tristrips`.
#[derive(Default)]
struct Polygon {
    corners: Vec<i64>,
    uv: Vec<f32>,
}

impl Polygon {
    /// The polygons of vertices that the row names; `Err` is what is no vertex's number.
    fn polygons(&self, is_strips: bool) -> Result<Vec<Vec<u32>>, i64> {
        let index = |&corner: &i64| u32::try_from(corner).map_err(|_| corner);
        if !is_strips {
            return Ok(vec![self.corners.iter().map(index).collect::<Result<_, _>>()?]);
        }
        let mut triangles = Vec::new();
        for strip in self.corners.split(|&corner| corner == -1) {
            let strip: Vec<u32> = strip.iter().map(index).collect::<Result<_, _>>()?;
            // Vertices that stand twice turn the strip.
            let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
            let sound = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
            triangles.extend(strip.windows(3).enumerate().map(turned).filter(sound).map(|t| t.to_vec()));
        }
        Ok(triangles)
    }
}

impl PropertyAccess for Polygon {
    fn new() -> Polygon {
        Polygon::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if INDICES.contains(&name) {
            self.corners = match property {
                Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
                Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
                Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
                _ => return PropertyAccessResult::UnsupportedType,
            };
        } else if name == "texcoord" {
            self.uv = match property {
                Property::ListFloat(list) => list,
                Property::ListDouble(list) => list.into_iter().map(|n| n as f32).collect(),
                _ => return PropertyAccessResult::Ignored,
            };
        } else {
            return PropertyAccessResult::Ignored;
        }
        PropertyAccessResult::Set
    }
}

/// A row that nobody needs.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Other {
        Other
    }
}
