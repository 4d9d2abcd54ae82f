//! Where a garment's files lie and how their bytes come in: paths as artists write them, limits, hashes. Knows no
//! format.

use super::shapes::parted;
use crate::diagnostic::{Diagnostic, Place};
use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use unicode_normalization::UnicodeNormalization;

/// Longest file that is read, bytes.
pub const FILE_BYTES: u64 = 256 << 20;

/// The bytes of a file that is not longer than `most`.
///
/// # Errors
/// It cannot be read, is no file or is longer.
pub fn read_at_most(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no file"));
    }
    let mut bytes = Vec::new();
    fs::File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::other(format!("it is longer than {} MB", most >> 20)));
    }
    Ok(bytes)
}

/// A garment's folder inside its assets folder.
#[derive(Clone, Debug)]
pub struct Folder {
    /// The assets folder: nothing outside it is read.
    root: PathBuf,
    /// The garment folder's name.
    id: String,
}

/// A file that the garment uses.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct InputFile {
    /// Relative to the assets folder, `/` as separator.
    pub path: String,
    /// Hash of the bytes, 64 hex digits.
    pub blake3: String,
}

impl Folder {
    /// The folder at `garment_dir`, which need not exist yet.
    ///
    /// # Errors
    /// The path has no parent or no printable name.
    pub fn new(garment_dir: &Path) -> Result<Folder, Box<Diagnostic>> {
        let located = std::path::absolute(garment_dir).ok();
        let id = located.as_deref().and_then(Path::file_name).and_then(|name| name.to_str());
        match (id, located.as_deref().and_then(Path::parent)) {
            (Some(id), Some(root)) => Ok(Folder { root: root.to_owned(), id: id.to_owned() }),
            _ => Err(Box::new(
                Diagnostic::error("garment-folder", garment_dir.to_string_lossy(), Place::File)
                    .problem("this is no garment folder")
                    .help("Give the folder that holds garment.toml, for example assets-src/komon."),
            )),
        }
    }

    /// The garment folder's name, which is the garment's ID.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The assets folder.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The name, relative to the assets folder, of a file that is written relative to the garment folder:
    /// `../bodies/b04.glb` gives `bodies/b04.glb`. A morph target that stands behind the file stays there.
    ///
    /// # Errors
    /// Says what is wrong with a path that is absolute, uses `\` or leaves the assets folder.
    pub fn name_of(&self, written: &str) -> Result<String, String> {
        if let (file, Some(morph)) = parted(written) {
            return match morph {
                "" => Err(format!("the path `{written}` names no morph target after its `#`")),
                _ => Ok(format!("{}#{morph}", self.name_of(file)?)),
            };
        }
        let has_drive = written.as_bytes().get(1) == Some(&b':');
        if written.is_empty() {
            return Err("the path is empty".to_owned());
        }
        if written.contains('\\') {
            return Err(format!("the path `{written}` has `\\`; write `/`"));
        }
        if written.starts_with('/') || has_drive {
            return Err(format!("the path `{written}` is absolute; write it relative to the garment folder"));
        }
        let mut parts = vec![self.id.as_str()];
        for part in written.split('/') {
            match part {
                "" | "." => {}
                ".." => {
                    if parts.pop().is_none() {
                        return Err(format!("the path `{written}` leaves the assets folder"));
                    }
                }
                _ => parts.push(part),
            }
        }
        Ok(parts.join("/"))
    }

    /// All bytes of a file named as by [`Folder::name_of`].
    ///
    /// # Errors
    /// What the system says; or that the file lies outside the assets folder (by a symbolic link) or is longer than
    /// [`FILE_BYTES`].
    pub fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        let path = self.root.join(name);
        if !path.canonicalize()?.starts_with(self.root.canonicalize()?) {
            return Err(io::Error::other("it is a link out of the assets folder"));
        }
        read_at_most(&path, FILE_BYTES)
    }

    /// Other garment folders whose names differ from this one's only by upper and lower case.
    #[must_use]
    pub fn same_but_for_case(&self) -> Vec<String> {
        let is_other = |id: &String| *id != self.id && id.to_lowercase() == self.id.to_lowercase();
        super::garment_ids(&self.root).unwrap_or_default().into_iter().filter(is_other).collect()
    }

    /// A file that may be meant by the missing `name`.
    #[must_use]
    pub fn similar(&self, name: &str) -> Option<Similar> {
        let (dir, file) = name.rsplit_once('/')?;
        let names = self.files(dir);
        let same = |key: fn(&str) -> String| names.iter().find(|other| key(other) == key(file)).cloned();
        if let Some(other) = same(composed) {
            return Some(Similar::Marks(other));
        }
        if let Some(other) = same(plain) {
            return Some(Similar::Width(other));
        }
        super::closest(file, names.iter().map(String::as_str)).map(|other| Similar::Other(other.to_owned()))
    }

    /// Files that lie beside those of `names` and end as they do, but are not among `used`.
    #[must_use]
    pub fn unused<'a>(&self, names: impl Iterator<Item = &'a str>, used: &BTreeSet<String>) -> Vec<String> {
        let ending = |name: &str| name.rsplit_once('.').map(|(_, ending)| ending.to_lowercase());
        let places = names.filter_map(|name| Some((name.rsplit_once('/')?.0.to_owned(), ending(name)?)));
        let places: BTreeSet<(String, String)> = places.collect();
        let beside = |(dir, wanted): &(String, String)| {
            let alike = self.files(dir).into_iter().filter(|file| ending(file).as_ref() == Some(wanted));
            alike.map(|file| format!("{dir}/{file}")).collect::<Vec<String>>()
        };
        let visible = |name: &String| !name.contains("/.");
        places.iter().flat_map(beside).filter(|name| visible(name) && !used.contains(name)).collect()
    }

    /// The names of the files in a folder of the assets folder, sorted.
    fn files(&self, dir: &str) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.root.join(dir)) else { return Vec::new() };
        let files = entries.flatten().filter(|entry| entry.path().is_file());
        let mut names: Vec<String> = files.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }
}

/// A file that may be meant by a name that no file has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Similar {
    /// It looks the same: か with its mark as one character or as two, as Macs and some archives write it.
    Marks(String),
    /// The same but for full-width characters, or upper and lower case.
    Width(String),
    /// Nearly the same.
    Other(String),
}

/// A name with every letter and its marks as one character (NFC).
pub(crate) fn composed(name: &str) -> String {
    name.nfc().collect()
}

/// A name without the difference of full and half width, upper and lower case.
fn plain(name: &str) -> String {
    name.nfkc().collect::<String>().to_lowercase()
}

/// The hash of a file's bytes as [`InputFile`] holds it.
#[must_use]
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_inside_the_assets_folder() {
        let folder = Folder::new(Path::new("assets-src/komon")).unwrap();
        let check =
            |written: &str, expected: Option<&str>| assert_eq!(folder.name_of(written).ok().as_deref(), expected);
        check("base.obj", Some("komon/base.obj"));
        check("poses/01 a.obj", Some("komon/poses/01 a.obj"));
        check("./poses//x.obj", Some("komon/poses/x.obj"));
        check("../bodies/b04.glb", Some("bodies/b04.glb"));
        check("../komon/../bodies/b04.glb", Some("bodies/b04.glb"));
        check("./all.glb#a/../b", Some("komon/all.glb#a/../b"));
        check("all.glb#", None);
        check("../../secret.glb#a", None);
        check("../../secret", None);
        check("a/../../../secret", None);
        check("/etc/passwd", None);
        check("C:/base.obj", None);
        check("poses\\01.obj", None);
        check("", None);
    }
}
