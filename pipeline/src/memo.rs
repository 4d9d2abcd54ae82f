//! Results of stages by the hash of what they were made from, as files in a cache folder. Knows no stage.
//!
//! The cache may be deleted at any time, and an entry that is damaged, missing or unreadable is computed again: losing
//! it costs time and nothing else, so its own I/O errors are no errors.

use bytemuck::Pod;
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};

/// Bytes of entries that a cache folder keeps; the oldest go first.
const KEPT_BYTES: u64 = 1 << 30;

/// What a result was made from: stage, the code of all stages, settings and every input.
pub struct Key(blake3::Hasher);

impl Key {
    /// The key of a stage, to which its inputs are added in order.
    #[must_use]
    pub fn new(stage: &str) -> Key {
        Key(blake3::Hasher::new()).text(env!("KITSUKE_STAGES")).text(stage)
    }

    /// Adds an array.
    #[must_use]
    pub fn array<T: Pod>(self, values: &[T]) -> Key {
        self.bytes(bytemuck::cast_slice(values))
    }

    /// Adds a text, for example the settings as `{:?}` prints them.
    #[must_use]
    pub fn text(self, text: &str) -> Key {
        self.bytes(text.as_bytes())
    }

    /// The length goes first, so that two arrays cannot pass for one.
    fn bytes(mut self, bytes: &[u8]) -> Key {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
        self
    }
}

/// Where a result came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The stage ran.
    Computed,
    /// An earlier run had computed it.
    Remembered,
}

/// A cache folder. Any number of threads and processes may use it at once.
#[derive(Clone, Debug)]
pub struct Memo {
    folder: PathBuf,
}

impl Memo {
    /// A cache in this folder, which is made when something is first put into it.
    #[must_use]
    pub fn new(folder: &Path) -> Memo {
        Memo { folder: folder.to_owned() }
    }

    /// The result of this key: read if it is there and whole, else computed and kept.
    ///
    /// # Errors
    /// Those of `compute`.
    pub fn recall<T: Pod, E>(
        &self,
        key: &Key,
        compute: impl FnOnce() -> Result<Vec<T>, E>,
    ) -> Result<(Vec<T>, Origin), E> {
        let path = self.folder.join(format!("{}.memo", key.0.finalize().to_hex()));
        if let Some(known) = read(&path) {
            return Ok((known, Origin::Remembered));
        }
        let result = compute()?;
        let _ = self.keep(&path, bytemuck::cast_slice(&result));
        Ok((result, Origin::Computed))
    }

    fn keep(&self, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
        std::fs::create_dir_all(&self.folder)?;
        let mut file = NamedTempFile::new_in(&self.folder)?;
        file.write_all(blake3::hash(bytes).as_bytes())?;
        file.write_all(bytes)?;
        file.into_temp_path().persist(path).map_err(|error| error.error)
    }

    /// Deletes the oldest files, leftovers of killed builds among them, until at most 1 GiB is left.
    pub fn trim(&self) {
        self.trim_to(KEPT_BYTES);
    }

    fn trim_to(&self, kept_bytes: u64) {
        let Ok(folder) = std::fs::read_dir(&self.folder) else { return };
        let mut entries: Vec<_> = folder
            .flatten()
            .filter_map(|entry| {
                let metadata = entry.metadata().ok()?;
                Some((metadata.modified().ok()?, entry.path(), metadata.len()))
            })
            .collect();
        entries.sort();
        let mut bytes: u64 = entries.iter().map(|(_, _, bytes)| bytes).sum();
        for (_, path, size) in entries {
            if bytes <= kept_bytes {
                break;
            }
            // Closing a temporary path deletes the file; one already gone is as good.
            let _ = TempPath::try_from_path(path).map(TempPath::close);
            bytes -= size;
        }
    }
}

/// The entry, if it is whole: a 32-byte checksum, then the array.
fn read<T: Pod>(path: &Path) -> Option<Vec<T>> {
    if std::fs::metadata(path).ok()?.len() > KEPT_BYTES {
        return None;
    }
    let bytes = std::fs::read(path).ok()?;
    let (checksum, array) = bytes.split_at_checked(blake3::OUT_LEN)?;
    let is_whole = blake3::hash(array).as_bytes() == checksum && array.len().is_multiple_of(size_of::<T>());
    is_whole.then(|| bytemuck::pod_collect_to_vec(array))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recall(memo: &Memo, input: u32) -> (Vec<u32>, Origin) {
        let key = Key::new("double").text("settings").array(&[input]);
        memo.recall(&key, || Ok::<_, ()>(vec![2 * input; 3])).unwrap()
    }

    #[test]
    fn what_was_computed_is_remembered_until_an_input_changes() {
        let folder = tempfile::tempdir().unwrap();
        let memo = Memo::new(&folder.path().join("made/when/needed"));
        assert_eq!(recall(&memo, 4), (vec![8; 3], Origin::Computed));
        assert_eq!(recall(&memo, 4), (vec![8; 3], Origin::Remembered));
        assert_eq!(recall(&memo, 5), (vec![10; 3], Origin::Computed));
    }

    #[test]
    fn every_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let memo = Memo::new(folder.path());
        recall(&memo, 4);
        let entry = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
        let whole = std::fs::read(&entry).unwrap();
        for i in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[i] ^= 0x10;
            std::fs::write(&entry, flipped).unwrap();
            assert_eq!(recall(&memo, 4), (vec![8; 3], Origin::Computed), "byte {i} flipped");
            std::fs::write(&entry, &whole[..i]).unwrap();
            assert_eq!(recall(&memo, 4), (vec![8; 3], Origin::Computed), "cut at byte {i}");
            assert_eq!(recall(&memo, 4), (vec![8; 3], Origin::Remembered), "mended after byte {i}");
        }
    }

    #[test]
    fn arrays_of_a_key_do_not_run_into_each_other() {
        let hash = |key: Key| key.0.finalize();
        assert_ne!(
            hash(Key::new("s").array(&[1u8, 2]).array(&[3u8])),
            hash(Key::new("s").array(&[1u8]).array(&[2u8, 3]))
        );
    }

    #[test]
    fn trimming_keeps_the_limit_and_removes_leftovers_too() {
        let folder = tempfile::tempdir().unwrap();
        let memo = Memo::new(folder.path());
        std::fs::write(folder.path().join(".tmp-killed"), [0; 500]).unwrap();
        (0..10).for_each(|input| drop(recall(&memo, input)));
        memo.trim_to(3 * 44);
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 3, "three entries of 44 bytes");
        assert!(!folder.path().join(".tmp-killed").exists(), "the oldest file goes first");
    }
}
