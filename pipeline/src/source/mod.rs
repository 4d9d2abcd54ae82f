//! Reads an artist's folder: the only place that knows file formats and derives `Deserialize`. `read` reads
//! everything; `input_files` only finds out which bytes a garment depends on. Knows no check of one file against another.

pub mod body;
pub(crate) mod causes;
pub mod clean_answer;
mod delimited;
pub mod folder;
pub mod form_lines;
pub mod formula;
pub mod hands_script;
pub mod import;
pub mod manifest;
pub mod masks;
pub mod measurements;
pub mod npy;
mod numbers;
pub mod obj;
pub mod paths;
pub mod picture;
pub(crate) mod polygon;
pub mod pose_rows;
pub mod rules;
mod shapes;
pub mod sizes;
pub mod tables;
pub mod units;

use crate::diagnostic::{self, Diagnostic, Place, Severity};
use crate::ir;
use causes::Causes;
pub use folder::InputFile;
use folder::{Folder, Similar};
use glam::DVec3;
use import::{ImportedMesh, Said};
use kitsuke::arrays::limits;
use kitsuke::tailoring::RuleSet;
use manifest::{Field, Manifest, Up};
use rayon::prelude::*;
use shapes::Shapes;
use sizes::SizeTable;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use tables::PoseTable;
use units::LengthUnit;

/// A garment's files as they were read, unchecked against each other. What could not be read has been reported and is
/// absent.
#[derive(Debug)]
pub struct Source {
    /// Where it lies.
    pub folder: Folder,
    /// The manifest.
    pub manifest: Manifest,
    /// The pose table.
    pub poses: Option<PoseTable>,
    /// The size table.
    pub sizes: Option<SizeTable>,
    /// Meshes by file name: base, targets, sizes, obi.
    pub meshes: BTreeMap<String, obj::Mesh>,
    /// Scans by file name.
    pub scans: BTreeMap<String, ScanFile>,
    /// Masks by file name.
    pub masks: BTreeMap<String, masks::Mask>,
    /// The body.
    pub body: Option<ir::Body>,
    /// The measured paths.
    pub paths: Option<paths::Paths>,
    /// Rule sets by file name.
    pub rules: BTreeMap<String, RuleSet>,
    /// The texture's bytes.
    pub texture_png: Option<Vec<u8>>,
}

/// A scan and what the manifest says of it.
#[derive(Clone, Debug)]
pub struct ScanFile {
    /// As in the file.
    pub mesh: ImportedMesh,
    /// Its unit and axes.
    pub said: Said,
    /// Places of the base and of the scan, each as its own file counts, with where the manifest says so.
    pub landmarks: Vec<(Place, manifest::Landmark)>,
}

/// What a file is read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Role {
    Mesh,
    Scan,
    Body,
    Mask,
    Paths,
    Rules,
    Texture,
}

/// A file that the manifest or the pose table names; for a shape perhaps with a morph target.
#[derive(Debug)]
struct Reference {
    name: String,
    role: Role,
    cited_in: String,
    place: Place,
}

impl Reference {
    /// The file, and its morph target.
    fn parted(&self) -> (&str, Option<&str>) {
        match self.role {
            Role::Mesh => shapes::parted(&self.name),
            _ => (&self.name, None),
        }
    }
}

/// Hashes every file that the garment uses, reading only the manifest and its tables.
///
/// # Errors
/// What is wrong with these, or which file cannot be read.
pub fn input_files(garment_dir: &Path) -> Result<Vec<InputFile>, Vec<Diagnostic>> {
    let mut report = Vec::new();
    let Some((folder, head)) = read_head(garment_dir, &mut report) else { return Err(diagnostic::sorted(report)) };
    let files = read_files(&folder, &head.references, &mut report, |_, bytes| folder::hash(&bytes));
    if report.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        return Err(diagnostic::sorted(report));
    }
    let mut inputs = head.inputs;
    inputs.extend(files.into_iter().map(|(path, blake3)| InputFile { path, blake3 }));
    inputs.sort();
    inputs.dedup();
    Ok(inputs)
}

/// Whether a text can be a garment's ID: a folder's name, a table's in the index, and a part of the pack's path.
#[must_use]
pub fn is_garment_id(text: &str) -> bool {
    let is_allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    text.len() <= limits::NAME_BYTES
        && text.starts_with(|c: char| c.is_ascii_alphanumeric())
        && text.chars().all(is_allowed)
}

/// The garment folders of an assets folder, sorted: those that hold a manifest and whose name does not begin with `_`.
///
/// # Errors
/// The folder cannot be read.
pub fn garment_ids(assets_dir: &Path) -> std::io::Result<Vec<String>> {
    let mut ids = Vec::new();
    for entry in std::fs::read_dir(assets_dir)? {
        let entry = entry?;
        if let Ok(name) = entry.file_name().into_string()
            && !name.starts_with('_')
            && entry.path().join(manifest::FILE_NAME).is_file()
        {
            ids.push(name);
        }
    }
    ids.sort();
    Ok(ids)
}

/// A position of a garment's files as metres, Y up, front +Z.
#[must_use]
pub fn in_metres(position: DVec3, unit: LengthUnit, up: Up) -> DVec3 {
    let turned = match up {
        Up::Y => position,
        Up::Z => DVec3::new(position.x, position.z, -position.y),
    };
    turned * unit.metres()
}

/// The name nearest to `word`, if it is near enough to be what was meant.
#[must_use]
pub fn closest<'a>(word: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let distance = |name: &str| strsim::damerau_levenshtein(&word.to_lowercase(), &name.to_lowercase());
    let nearest = names.into_iter().map(|name| (distance(name), name)).min()?;
    (nearest.0 <= 1 + word.chars().count() / 4).then_some(nearest.1)
}

/// A text file's content.
fn utf8<'a>(file: &str, bytes: &'a [u8], report: &mut Vec<Diagnostic>) -> Option<&'a str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Some(text),
        Err(error) => {
            let line = bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() as u32 + 1;
            let problem = match bytes {
                [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "the file is UTF-16 text",
                _ => "the file is not UTF-8 text",
            };
            report.push(
                Diagnostic::error("encoding", file, Place::Line(line)).problem(problem).help("Save it as UTF-8."),
            );
            None
        }
    }
}

/// The manifest and its tables, and the files that they name.
struct Head {
    manifest: Manifest,
    poses: Option<PoseTable>,
    sizes: Option<SizeTable>,
    references: Vec<Reference>,
    inputs: Vec<InputFile>,
}

fn read_head(garment_dir: &Path, report: &mut Vec<Diagnostic>) -> Option<(Folder, Head)> {
    let folder = Folder::new(garment_dir).map_err(|diagnostic| report.push(*diagnostic)).ok()?;
    let manifest_file = format!("{}/{}", folder.id(), manifest::FILE_NAME);
    let mut inputs = Vec::new();
    let bytes = match folder.read(&manifest_file) {
        Ok(bytes) => bytes,
        Err(error) => {
            report.push(
                Diagnostic::error("file", &manifest_file, Place::File)
                    .problem(format!("the manifest cannot be read: {error}"))
                    .help("A garment folder holds garment.toml; `cargo xtask new ID` makes one."),
            );
            return None;
        }
    };
    inputs.push(InputFile { path: manifest_file.clone(), blake3: folder::hash(&bytes) });
    let manifest = manifest::read(&manifest_file, &bytes, report)?;
    let mut cite = Citations { folder: &folder, manifest_file: &manifest_file, references: Vec::new(), report };
    let poses_name = cite.resolve(manifest.poses.as_ref());
    let sizes_name = cite.resolve(manifest.sizes.as_ref());
    cite.add(manifest.base.as_ref(), Role::Mesh);
    cite.add(manifest.obi.as_ref(), Role::Mesh);
    cite.add(manifest.body.as_ref(), Role::Body);
    cite.add(manifest.paths.as_ref(), Role::Paths);
    cite.add(manifest.texture.as_ref(), Role::Texture);
    cite.add_rules(manifest.rules.as_deref().unwrap_or_default());
    for driver in &manifest.drivers {
        cite.add(driver.mask.as_ref(), Role::Mask);
    }
    for scan in &manifest.scans {
        cite.add(scan.file.as_ref(), Role::Scan);
    }
    let mut references = cite.references;
    let scans: Vec<String> =
        references.iter().filter(|cited| cited.role == Role::Scan).map(|cited| cited.name.clone()).collect();
    let mut table = |name: &Option<(String, Place)>, report: &mut Vec<Diagnostic>| {
        let (name, place) = name.as_ref()?;
        let bytes = folder.read(name);
        let bytes =
            bytes.map_err(|error| report.push(missing_file(&folder, name, &manifest_file, place, &error))).ok()?;
        inputs.push(InputFile { path: name.clone(), blake3: folder::hash(&bytes) });
        Some((name.clone(), bytes))
    };
    let poses = table(&poses_name, report).and_then(|(name, bytes)| tables::read(&name, &bytes, report));
    let sizes = table(&sizes_name, report).and_then(|(name, bytes)| sizes::read(&name, &bytes, report));
    // Row 0 is the base, which the manifest has named.
    let targets =
        poses.iter().flat_map(|table| table.rows.iter().skip(1)).map(|row| (&poses_name, row.line, &row.file));
    let shapes = sizes.iter().flat_map(|table| table.rows.iter().skip(1)).map(|row| (&sizes_name, row.line, &row.file));
    let rows = targets.map(|row| (row, false)).chain(shapes.map(|row| (row, true)));
    let mut idle: BTreeSet<&String> = scans.iter().collect();
    for ((table, line, file), is_size) in rows {
        if let Ok(name) = folder.name_of(file) {
            idle.remove(&name);
        }
        let (place, cited_in) = (Place::Line(line), table.as_ref().map(|(name, _)| name.clone()).unwrap_or_default());
        match folder.name_of(file) {
            Ok(name) if scans.contains(&name) && is_size => {}
            Ok(name) if scans.contains(&name) => report.push(
                Diagnostic::error("scan-pose", cited_in, place)
                    .problem(format!("{name} is a scan, and scans serve as sizes only"))
                    .help("Lay the posed base onto it in another program (Wrap, ZWrap) and name the OBJ that comes out, or remove its [[scan]]: here only the base in its T-pose is laid onto scans."),
            ),
            Ok(name) => references.push(Reference { name, role: Role::Mesh, cited_in, place }),
            Err(problem) => report.push(
                Diagnostic::error("path", cited_in, place)
                    .problem(problem)
                    .help("Name a file inside the assets folder, relative to the garment folder, with `/`."),
            ),
        }
    }
    // Of tables that cannot be read nobody knows what they name.
    let is_known = sizes.is_some() || manifest.sizes.is_none();
    for scan in references.iter().filter(|cited| is_known && cited.role == Role::Scan && idle.contains(&cited.name)) {
        report.push(
            Diagnostic::warning("unused-file", &manifest_file, scan.place.clone())
                .problem(format!("no row of the size table names the scan {}", scan.name))
                .help("Add a row for it to the size table, or remove its [[scan]]."),
        );
    }
    Some((folder, Head { manifest, poses, sizes, references, inputs }))
}

/// Collects the files that the manifest names.
struct Citations<'a> {
    folder: &'a Folder,
    manifest_file: &'a str,
    references: Vec<Reference>,
    report: &'a mut Vec<Diagnostic>,
}

impl Citations<'_> {
    fn resolve(&mut self, field: Option<&Field<String>>) -> Option<(String, Place)> {
        let field = field?;
        match self.folder.name_of(field.get()?) {
            Ok(name) => Some((name, field.place())),
            Err(problem) => {
                self.report.push(
                    Diagnostic::error("path", self.manifest_file, field.place())
                        .problem(problem)
                        .help("Name a file inside the assets folder, relative to the garment folder, with `/`."),
                );
                None
            }
        }
    }

    fn add(&mut self, field: Option<&Field<String>>, role: Role) {
        if let Some((name, place)) = self.resolve(field) {
            self.references.push(Reference { name, role, cited_in: self.manifest_file.to_owned(), place });
        }
    }

    /// Rule sets go by their names, not by paths.
    fn add_rules(&mut self, names: &[Field<String>]) {
        // A folder that cannot be read has no rules.
        let known = match names {
            [] => Vec::new(),
            _ => rules::names(&self.folder.root().join(rules::FOLDER)).unwrap_or_default(),
        };
        for field in names {
            let Some(name) = field.get() else { continue };
            if known.contains(name) {
                let cited_in = self.manifest_file.to_owned();
                self.references.push(Reference {
                    name: rules::file(name),
                    role: Role::Rules,
                    cited_in,
                    place: field.place(),
                });
                continue;
            }
            let problem = match closest(name, known.iter().map(String::as_str)) {
                Some(similar) => format!("there are no rules `{name}`; did you mean `{similar}`?"),
                None => format!("there are no rules `{name}`"),
            };
            let help = match &known[..] {
                [] => format!("Rule sets lie beside the garment's folder, as {}.", rules::file("NAME")),
                known => format!("There are {}.", known.join(", ")),
            };
            self.report.push(
                Diagnostic::error("unknown-rules", self.manifest_file, field.place()).problem(problem).help(help),
            );
        }
    }
}

fn missing_file(folder: &Folder, name: &str, cited_in: &str, place: &Place, error: &std::io::Error) -> Diagnostic {
    let mut reason = match error.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_owned(),
        _ => error.to_string(),
    };
    let help = match folder.similar(name) {
        Some(Similar::Marks(_)) => {
            reason += ", but one whose name looks the same and is written differently: letter and mark as two characters, as \
                       Macs and some archives write them";
            "Rename the file: type its name anew, then write it anew here, too.".to_owned()
        }
        Some(Similar::Width(similar)) => {
            reason += &format!(", but `{similar}`: full-width characters, or upper and lower case, differ");
            format!("Write {similar} here.")
        }
        Some(Similar::Other(similar)) => format!("Beside it lies `{similar}`; is that meant?"),
        None => "Put the file there, or correct the path, which is relative to the garment folder.".to_owned(),
    };
    Diagnostic::error("file", cited_in, place.clone()).problem(format!("{name} cannot be read: {reason}")).help(help)
}

/// Reads all named files in parallel, each once per role, and gives what `decode` makes of them, by name.
fn read_files<T: Send>(
    folder: &Folder,
    references: &[Reference],
    report: &mut Vec<Diagnostic>,
    decode: impl Fn(&Reference, Vec<u8>) -> T + Sync,
) -> Vec<(String, T)> {
    let wanted: BTreeMap<(&str, Role), &Reference> = references.iter().map(|r| ((r.parted().0, r.role), r)).collect();
    let read: Vec<_> = wanted
        .into_par_iter()
        .map(|((name, _), reference)| (name, folder.read(name).map(|bytes| decode(reference, bytes))))
        .collect();
    let mut files = Vec::new();
    let mut missing = BTreeMap::new();
    for (name, result) in read {
        match result {
            Ok(decoded) => files.push((name.to_owned(), decoded)),
            Err(error) => {
                missing.insert(name, error);
            }
        }
    }
    let mut causes = Causes::default();
    for reference in references {
        let (Reference { cited_in, place, .. }, name) = (reference, reference.parted().0);
        if let Some(error) = missing.get(name) {
            causes.add("file", format!("{cited_in} {name}"), || missing_file(folder, name, cited_in, place, error));
        }
    }
    causes.report("row", report);
    files
}

/// What a file was decoded to.
enum Decoded {
    Scan(Option<Box<ImportedMesh>>),
    Mesh(Option<obj::Mesh>),
    Shapes(Option<Shapes>),
    Body(Option<Box<ir::Body>>),
    Mask(Option<masks::Mask>),
    Paths(Option<paths::Paths>),
    Rules(Option<RuleSet>),
    Texture(Option<Vec<u8>>),
}

impl Source {
    /// Takes the shapes of a glTF file for those that cite them.
    fn take<'a>(&mut self, cited: impl Iterator<Item = &'a Reference>, shapes: &Shapes, report: &mut Vec<Diagnostic>) {
        let mut causes = Causes::default();
        for reference in cited {
            let (file, morph) = reference.parted();
            if let Some(mesh) = shapes.meshes.get(morph.unwrap_or_default()) {
                self.meshes.insert(reference.name.clone(), mesh.clone());
                continue;
            }
            let morph = morph.unwrap_or_default();
            let problem = match closest(morph, shapes.morphs.iter().map(String::as_str)) {
                Some(similar) => format!("{file} has no morph target `{morph}`; did you mean `{similar}`?"),
                None => format!("{file} has no morph target `{morph}`"),
            };
            let help = match &shapes.morphs[..] {
                [] => "It has none: export it with its shape keys (Blender: Data > Shape Keys).".to_owned(),
                names => format!("It has {}.", names.join(", ")),
            };
            causes.add("morph-target", reference.name.clone(), || {
                Diagnostic::error("morph-target", &reference.cited_in, reference.place.clone())
                    .problem(problem)
                    .help(help)
            });
        }
        causes.report("row", report);
        self.check_unit(report);
    }

    /// Numbers of glTF are metres with +Y up, whatever stands beside it.
    fn check_unit(&self, report: &mut Vec<Diagnostic>) {
        let manifest_file = format!("{}/{}", self.folder.id(), manifest::FILE_NAME);
        let unit = self.manifest.unit.as_ref().filter(|unit| unit.get().is_some_and(|unit| *unit != LengthUnit::M));
        let up = self.manifest.up.as_ref().filter(|up| up.get() == Some(&Up::Z));
        for place in [unit.map(Field::place), up.map(Field::place)].into_iter().flatten() {
            report.push(
                Diagnostic::error("gltf-unit", &manifest_file, place)
                    .problem("shapes of glTF files are in metres with +Y up, and this says otherwise of all shapes")
                    .help("Remove it, and export OBJ files that stand beside it in metres with +Y up, too."),
            );
        }
    }
}

/// Reads the manifest and everything that it names. What is wrong with single files goes into the report; nothing is
/// returned where there is no manifest to go by.
#[must_use]
pub fn read(garment_dir: &Path, report: &mut Vec<Diagnostic>) -> (Option<Source>, Vec<InputFile>) {
    let Some((folder, head)) = read_head(garment_dir, report) else { return (None, Vec::new()) };
    let mut morphs: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for (file, morph) in head.references.iter().map(Reference::parted) {
        morphs.entry(file).or_default().extend(morph.map(str::to_owned));
    }
    let files = read_files(&folder, &head.references, report, |reference, bytes| {
        let (name, mut report) = (reference.parted().0, Vec::new());
        let hash = folder::hash(&bytes);
        let decoded = match reference.role {
            Role::Mesh if shapes::is_gltf(name) => {
                Decoded::Shapes(shapes::read(name, &bytes, &morphs[name], &mut report))
            }
            Role::Mesh => Decoded::Mesh(obj::read(name, &bytes, &mut report)),
            Role::Scan => {
                let beside = folder.root().join(name);
                Decoded::Scan(import::read_bytes(name, &bytes, beside.parent(), &mut report).map(Box::new))
            }
            Role::Body => Decoded::Body(body::read(name, &bytes, &mut report).map(Box::new)),
            Role::Mask => Decoded::Mask(masks::read(name, &bytes, &mut report)),
            Role::Paths => Decoded::Paths(paths::read(name, &bytes, &mut report)),
            Role::Rules => Decoded::Rules(rules::read(name, rules::name(name), &bytes, &mut report)),
            Role::Texture => Decoded::Texture(masks::read_texture(name, bytes, &mut report)),
        };
        (decoded, report, hash)
    });
    let mut source = Source {
        folder,
        manifest: head.manifest,
        poses: head.poses,
        sizes: head.sizes,
        meshes: BTreeMap::new(),
        scans: BTreeMap::new(),
        masks: BTreeMap::new(),
        body: None,
        paths: None,
        rules: BTreeMap::new(),
        texture_png: None,
    };
    let mut inputs = head.inputs;
    for (path, (decoded, mut found, blake3)) in files {
        report.append(&mut found);
        inputs.push(InputFile { path: path.clone(), blake3 });
        match decoded {
            Decoded::Scan(mesh) => {
                let said = source.manifest.scans.iter().find(|said| {
                    let file = said.file.as_ref().and_then(Field::get);
                    file.is_some_and(|file| source.folder.name_of(file).as_ref() == Ok(&path))
                });
                if let (Some(mesh), Some(said)) = (mesh, said) {
                    let unit = said.unit.as_ref().and_then(|unit| unit.get().copied());
                    let up = said.up.as_ref().and_then(|up| up.get()).map(|up| match up {
                        Up::Y => DVec3::Y,
                        Up::Z => DVec3::Z,
                    });
                    let front = said.front.as_ref().and_then(|front| front.get()).map(|axis| axis.0);
                    let landmarks = said.landmarks.iter().flatten();
                    let landmarks = landmarks.filter_map(|field| Some((field.place(), *field.get()?))).collect();
                    let said = Said { unit, up, front };
                    source.scans.insert(path, ScanFile { mesh: *mesh, said, landmarks });
                }
            }
            Decoded::Shapes(shapes) => {
                let of_file =
                    head.references.iter().filter(|cited| cited.role == Role::Mesh && cited.parted().0 == path);
                if let Some(shapes) = shapes {
                    source.take(of_file, &shapes, report);
                }
            }
            Decoded::Mesh(mesh) => source.meshes.extend(mesh.map(|mesh| (path, mesh))),
            Decoded::Mask(mask) => source.masks.extend(mask.map(|mask| (path, mask))),
            Decoded::Body(body) => source.body = body.map(|body| *body),
            Decoded::Paths(paths) => source.paths = paths,
            Decoded::Rules(rules) => source.rules.extend(rules.map(|rules| (path, rules))),
            Decoded::Texture(bytes) => source.texture_png = bytes,
        }
    }
    inputs.sort();
    inputs.dedup();
    (Some(source), inputs)
}
