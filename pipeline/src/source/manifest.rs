//! `garment.toml`: the manifest of a garment. Its types give both the reader and the JSON Schema for editors. Knows
//! nothing of the files that it names.

use super::closest;
use super::units::{Angle, Length, LengthUnit, one_of};
use crate::diagnostic::{Diagnostic, Place};
use kitsuke::skeleton::Bone;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};
use serde_json::Value as Json;
use std::borrow::Cow;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The manifest's name in every garment folder.
pub const FILE_NAME: &str = "garment.toml";

/// A kimono's manifest. A key that is absent here was absent or wrong in the file, and has been reported.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(title = "garment.toml", description = "A kimono's manifest.", deny_unknown_fields)]
pub struct Manifest {
    /// The name people read.
    #[schemars(required)]
    pub name: Option<Field<String>>,
    /// Unit of the numbers in base, targets and obi; `m` unless given.
    pub unit: Option<Field<LengthUnit>>,
    /// Which axis points up in base, targets and obi: `+Y` (front +Z, the default) or `+Z` (front -Y).
    pub up: Option<Field<Up>>,
    /// How far the posed surface, at the targets and between them, may lie from what the files give before they become small numbers; `0.2 mm`
    /// unless given.
    pub budget: Option<Field<Length>>,
    /// The farthest that any point of the cloth may move when one joint turns by one degree; a pack that is faster is an
    /// error. By default anything goes.
    pub speed_budget: Option<Field<Length>>,
    /// The farthest that any target may lie from what the other targets predict for its pose; a pack that predicts worse
    /// is an error: a pose is missing. By default anything goes.
    pub unseen_budget: Option<Field<Length>>,
    /// The deepest that any point of the cloth may lie in the body in the poses of the audit; a pack that is worse is an error. By
    /// default anything goes.
    pub inside_budget: Option<Field<Length>>,
    /// The most shapes per group of drivers that the build adds to keep the cloth out of the body between the targets, 0 to 32; `0`
    /// unless given. Each makes the pack larger and the frame slower.
    pub correctives: Option<Field<ShapeCount>>,
    /// The kimono in the T-pose, an OBJ or GLB file.
    #[schemars(required)]
    pub base: Option<Field<String>>,
    /// The colour texture, a PNG file.
    pub texture: Option<Field<String>>,
    /// Whether the texture travels in the pack; `true` unless given. `false` where apps bring it in another way.
    pub texture_in_pack: Option<Field<bool>>,
    /// The obi as a band of its own, an OBJ file.
    pub obi: Option<Field<String>>,
    /// The body on which base and targets were made, a GLB file with skeleton and skin weights.
    #[schemars(required)]
    pub body: Option<Field<String>>,
    /// The pose table, a CSV file: one row per target (file, or `FILE.glb#NAME` for a morph target; name; joint rotations); the first row
    /// is the base.
    #[schemars(required)]
    pub poses: Option<Field<String>>,
    /// The tailoring dimensions as paths along edges of the base, a TOML file.
    pub paths: Option<Field<String>>,
    /// The sizes, a CSV file: one row per body for which the kimono exists in the T-pose (file, body, measurements, joints); the first
    /// row is the base.
    pub sizes: Option<Field<String>>,
    /// The rule sets by which the sizes are fitted to wearers, files `rules/NAME.toml` beside the garment's folder; the first is the
    /// kimono's own.
    pub rules: Option<Vec<Field<String>>>,
    /// `auto` (the default): regions grow from where the targets differ; `painted`: the drivers' masks, as they are.
    pub regions: Option<Field<RegionSource>>,
    /// The joints that choose among the targets, each with the region of the kimono that it moves.
    #[serde(default, rename = "driver")]
    pub drivers: Vec<DriverEntry>,
    /// Sizes that are scans: shapes of any topology, onto which the base is laid.
    #[serde(default, rename = "scan")]
    pub scans: Vec<ScanEntry>,
    /// Joints that the kimono keeps from turning farther than its targets do: a skirt stops a stride.
    #[serde(default, rename = "limit")]
    pub limits: Vec<LimitEntry>,
}

/// One `[[limit]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct LimitEntry {
    /// The joints that are held back together, by their VRM 1.0 names.
    #[schemars(required)]
    pub joints: Option<Vec<Field<BoneName>>>,
    /// How much farther than the targets they may turn at most.
    #[schemars(required)]
    pub margin: Option<Field<Angle>>,
}

/// One `[[scan]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct ScanEntry {
    /// The scan (OBJ, PLY, GLB, glTF, FBX); a row of the size table names the same file.
    #[schemars(required)]
    pub file: Option<Field<String>>,
    /// Its unit; needed where the file does not say it.
    pub unit: Option<Field<LengthUnit>>,
    /// Which of its axes points up: `+Y` (then the front is +Z) or `+Z` (then it is -Y); as the file says, else `+Y`, unless given.
    pub up: Option<Field<Up>>,
    /// Which of its axes points to the wearer's front, where it is another one: `+X`, `-X`, `+Y`, `-Y`, `+Z` or `-Z`.
    pub front: Option<Field<Axis>>,
    /// Places of the base and where they lie in the scan; a scan needs none, but one that is laid on badly is helped by a few.
    pub landmarks: Option<Vec<Field<Landmark>>>,
}

/// A place of the base and the same in a scan, each as its own file counts.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(deny_unknown_fields)]
pub struct Landmark {
    /// In the base's file, x, y and z.
    pub base: [f64; 3],
    /// In the scan's file.
    pub scan: [f64; 3],
}

/// One `[[driver]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct DriverEntry {
    /// For example `rightShoulder`.
    #[schemars(required)]
    pub name: Option<Field<String>>,
    /// The joints whose rotations are compared, by their VRM 1.0 names.
    #[schemars(required)]
    pub joints: Option<Vec<Field<BoneName>>>,
    /// Poses farther away than this are not similar.
    #[schemars(required)]
    pub threshold: Option<Field<Angle>>,
    /// Drivers of one group blend together, for example the shoulder and the elbow that move the same sleeve. By
    /// default every driver is a group of its own.
    pub group: Option<Field<String>>,
    /// The painted region, a grey PNG file in the texture's space; needed when `regions = "painted"`.
    pub mask: Option<Field<String>>,
}

/// How many shapes: a whole number from 0 to 32.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub struct ShapeCount(pub u8);

impl ShapeCount {
    const MOST: u8 = 32;
}

impl TryFrom<toml::Value> for ShapeCount {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<ShapeCount, String> {
        let count = value.as_integer().and_then(|count| u8::try_from(count).ok()).filter(|count| *count <= Self::MOST);
        count.map(ShapeCount).ok_or_else(|| format!("{value} is no whole number from 0 to {}", Self::MOST))
    }
}

impl JsonSchema for ShapeCount {
    fn schema_name() -> Cow<'static, str> {
        "ShapeCount".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "integer", "minimum": 0, "maximum": Self::MOST })
    }
}

/// Which axis points up: `+Y` (then the front is +Z) or `+Z` (then it is -Y).
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub enum Up {
    Y,
    Z,
}

impl Up {
    const ALL: [(&'static str, Up); 2] = [("+Y", Up::Y), ("+Z", Up::Z)];
}

impl TryFrom<toml::Value> for Up {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Up, String> {
        one_of("axis that can point up", &value, Up::ALL)
    }
}

impl JsonSchema for Up {
    fn schema_name() -> Cow<'static, str> {
        "Up".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": Up::ALL.map(|(name, _)| name) })
    }
}

/// A direction along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub struct Axis(pub glam::DVec3);

impl Axis {
    const ALL: [(&'static str, Axis); 6] = [
        ("+X", Axis(glam::DVec3::X)),
        ("-X", Axis(glam::DVec3::NEG_X)),
        ("+Y", Axis(glam::DVec3::Y)),
        ("-Y", Axis(glam::DVec3::NEG_Y)),
        ("+Z", Axis(glam::DVec3::Z)),
        ("-Z", Axis(glam::DVec3::NEG_Z)),
    ];
}

impl TryFrom<toml::Value> for Axis {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Axis, String> {
        one_of("axis", &value, Axis::ALL)
    }
}

impl JsonSchema for Axis {
    fn schema_name() -> Cow<'static, str> {
        "Axis".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": Axis::ALL.map(|(name, _)| name) })
    }
}

/// Where the regions come from: grown from where the targets differ, or painted.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub enum RegionSource {
    Auto,
    Painted,
}

impl RegionSource {
    const ALL: [(&'static str, RegionSource); 2] = [("auto", RegionSource::Auto), ("painted", RegionSource::Painted)];
}

impl TryFrom<toml::Value> for RegionSource {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<RegionSource, String> {
        one_of("way to make regions", &value, RegionSource::ALL)
    }
}

impl JsonSchema for RegionSource {
    fn schema_name() -> Cow<'static, str> {
        "RegionSource".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": RegionSource::ALL.map(|(name, _)| name) })
    }
}

/// A bone by its VRM 1.0 name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub struct BoneName(pub Bone);

impl TryFrom<toml::Value> for BoneName {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<BoneName, String> {
        let name = value.as_str().ok_or("a bone is a VRM 1.0 name, for example \"leftUpperArm\"")?;
        Bone::from_name(name).map(BoneName).ok_or_else(|| unknown_bone(name))
    }
}

/// Says that no bone is called so, and which one nearly is.
pub(super) fn unknown_bone(name: &str) -> String {
    match closest(name, Bone::ALL.iter().map(|bone| bone.name())) {
        Some(similar) => format!("VRM 1.0 has no bone `{name}`; did you mean `{similar}`?"),
        None => format!("VRM 1.0 has no bone `{name}`"),
    }
}

impl JsonSchema for BoneName {
    fn schema_name() -> Cow<'static, str> {
        "Bone".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let names: Vec<&str> = Bone::ALL.iter().map(|bone| bone.name()).collect();
        json_schema!({ "type": "string", "enum": names })
    }
}

/// A value with its place in the file. A wrong value keeps its reason, so that one run can report all of them.
#[derive(Debug)]
pub struct Field<T> {
    /// Byte range in the file.
    pub span: Range<usize>,
    value: Result<T, String>,
}

impl<T> Field<T> {
    /// The value, unless it was wrong.
    pub fn get(&self) -> Option<&T> {
        self.value.as_ref().ok()
    }

    /// Where it stands.
    pub fn place(&self) -> Place {
        Place::Span(self.span.clone())
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for Field<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Field<T>, D::Error> {
        let raw = Spanned::<toml::Value>::deserialize(deserializer)?;
        let span = raw.span();
        let value = T::deserialize(raw.into_inner()).map_err(|error| error.message().to_owned());
        Ok(Field { span, value })
    }
}

impl<T: JsonSchema> JsonSchema for Field<T> {
    fn schema_name() -> Cow<'static, str> {
        T::schema_name()
    }

    fn schema_id() -> Cow<'static, str> {
        T::schema_id()
    }

    fn inline_schema() -> bool {
        T::inline_schema()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        T::json_schema(generator)
    }
}

/// Reads a manifest and reports everything that its grammar and types can tell; nothing where it is no TOML at all.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Manifest> {
    let text = super::utf8(file, bytes, report)?;
    let manifest = parse::<Manifest>(file, text, report)?;
    let Manifest {
        name,
        unit,
        up,
        budget,
        speed_budget,
        unseen_budget,
        inside_budget,
        correctives,
        base,
        texture,
        texture_in_pack,
        obi,
        body,
        poses,
        paths,
        sizes,
        rules,
        regions,
        drivers,
        scans,
        limits,
    } = &manifest;
    for text in [name, base, texture, obi, body, poses, paths, sizes].into_iter().flatten() {
        report_wrong(file, text, report);
    }
    rules.iter().flatten().for_each(|field| report_wrong(file, field, report));
    unit.iter().for_each(|field| report_wrong(file, field, report));
    up.iter().for_each(|field| report_wrong(file, field, report));
    [budget, speed_budget, unseen_budget, inside_budget]
        .into_iter()
        .flatten()
        .for_each(|field| report_wrong(file, field, report));
    texture_in_pack.iter().for_each(|field| report_wrong(file, field, report));
    correctives.iter().for_each(|field| report_wrong(file, field, report));
    regions.iter().for_each(|field| report_wrong(file, field, report));
    for DriverEntry { name, joints, threshold, group, mask } in drivers {
        name.iter().chain(group).chain(mask).for_each(|field| report_wrong(file, field, report));
        threshold.iter().for_each(|field| report_wrong(file, field, report));
        joints.iter().flatten().for_each(|field| report_wrong(file, field, report));
    }
    for ScanEntry { file: scan, unit, up, front, landmarks } in scans {
        landmarks.iter().flatten().for_each(|field| report_wrong(file, field, report));
        scan.iter().for_each(|field| report_wrong(file, field, report));
        unit.iter().for_each(|field| report_wrong(file, field, report));
        up.iter().for_each(|field| report_wrong(file, field, report));
        front.iter().for_each(|field| report_wrong(file, field, report));
    }
    for LimitEntry { joints, margin } in limits {
        margin.iter().for_each(|field| report_wrong(file, field, report));
        joints.iter().flatten().for_each(|field| report_wrong(file, field, report));
    }
    Some(manifest)
}

/// Reports a field whose value is wrong.
pub(super) fn report_wrong<T>(file: &str, field: &Field<T>, report: &mut Vec<Diagnostic>) {
    if let Err(reason) = &field.value {
        report.push(
            Diagnostic::error("wrong-value", file, field.place())
                .problem(reason.clone())
                .help("assets-src/README.md lists the keys, their values and units."),
        );
    }
}

/// Parses TOML into `T` and reports syntax, unknown and missing keys by the schema of `T`.
pub(super) fn parse<T: DeserializeOwned + JsonSchema>(
    file: &str,
    text: &str,
    report: &mut Vec<Diagnostic>,
) -> Option<T> {
    let (document, errors) = DeTable::parse_recoverable(text);
    let syntax = |error: &toml::de::Error| {
        let place = error.span().map_or(Place::File, Place::Span);
        Diagnostic::error("toml-syntax", file, place)
            .problem(error.message())
            .help("Mend the TOML here; strings stand in double quotes.")
    };
    if !errors.is_empty() {
        // One slip makes several errors in its line; the first says enough.
        let line =
            |error: &toml::de::Error| error.span().and_then(|span| Some(text.get(..span.start)?.matches('\n').count()));
        for (i, error) in errors.iter().enumerate() {
            if !errors[..i].iter().any(|earlier| line(earlier) == line(error)) {
                report.push(syntax(error));
            }
        }
        return None;
    }
    keys(file, document.get_ref(), None, &schema_of::<T>(), None, report);
    toml::from_str(text).map_err(|error| report.push(syntax(&error))).ok()
}

/// Reports the keys of `table` that `schema` does not know, and those that it wants and does not find.
fn keys(
    file: &str,
    table: &DeTable<'_>,
    span: Option<Range<usize>>,
    root: &Json,
    schema: Option<&Json>,
    report: &mut Vec<Diagnostic>,
) {
    let schema = resolve(root, schema.unwrap_or(root));
    let known = schema["properties"].as_object();
    let of_any_key = &schema["additionalProperties"];
    for (key, value) in table {
        let name = key.get_ref().as_ref();
        let inner = match known.and_then(|known| known.get(name)) {
            Some(inner) => inner,
            None if of_any_key.is_object() => of_any_key,
            None => {
                let similar = closest(name, known.into_iter().flatten().map(|(known, _)| known.as_str()));
                let problem = match similar {
                    Some(similar) => format!("there is no key `{name}`; did you mean `{similar}`?"),
                    None => format!("there is no key `{name}`"),
                };
                let all: Vec<&str> = known.into_iter().flatten().map(|(known, _)| known.as_str()).collect();
                report.push(
                    Diagnostic::error("unknown-key", file, Place::Span(key.span()))
                        .problem(problem)
                        .help(format!("The keys here are {}.", all.join(", "))),
                );
                continue;
            }
        };
        match value.get_ref() {
            DeValue::Table(table) => keys(file, table, Some(key.span()), root, Some(inner), report),
            DeValue::Array(array) => {
                for item in array.iter() {
                    if let DeValue::Table(table) = item.get_ref() {
                        let inner = &resolve(root, inner)["items"];
                        keys(file, table, Some(item.span()), root, Some(inner), report);
                    }
                }
            }
            _ => {}
        }
    }
    for missing in schema["required"].as_array().into_iter().flatten().filter_map(Json::as_str) {
        if !table.contains_key(missing) {
            let described = resolve(root, &schema["properties"][missing]);
            let described = schema["properties"][missing]["description"].as_str().or(described["description"].as_str());
            report.push(
                Diagnostic::error("missing-key", file, span.clone().map_or(Place::File, Place::Span))
                    .problem(format!("the key `{missing}` is missing"))
                    .help(format!("Add `{missing} = …`: {}", described.unwrap_or("see assets-src/README.md."))),
            );
        }
    }
}

/// Follows `$ref` (schemars writes it alone or as the only member of `allOf`).
fn resolve<'a>(root: &'a Json, schema: &'a Json) -> &'a Json {
    let reference = schema["$ref"].as_str().or_else(|| schema["allOf"][0]["$ref"].as_str());
    reference.and_then(|path| root.pointer(path.trim_start_matches('#'))).unwrap_or(schema)
}

fn schema_of<T: JsonSchema>() -> Json {
    SchemaSettings::draft07().into_generator().into_root_schema_for::<T>().to_value()
}

/// The JSON Schema (draft 7) of `garment.toml`, as text that ends with a newline.
#[must_use]
pub fn schema() -> String {
    format!("{:#}\n", schema_of::<Manifest>())
}
