//! The fuzzers' corpora, replayed: every input that once reached new code, through the same functions.

use kitsuke_tests::hostile::TARGETS;
use std::path::Path;

#[test]
fn the_corpora_do_no_harm() {
    for (target, read) in TARGETS {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
        let entries: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(entries.len() >= 20, "{} has {} inputs", folder.display(), entries.len());
        for path in entries {
            read(&std::fs::read(path).unwrap());
        }
    }
}
