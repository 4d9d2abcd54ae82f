//! The fuzzers' corpora, replayed: every input that once reached new code, through the same functions.

use kitsuke::pack::write::{write, write_with};
use kitsuke_tests::container::Container;
use kitsuke_tests::hostile::{FIELDS, SMALL_PACK, TARGETS};
use kitsuke_tests::random::Numbers;
use kitsuke_tests::{random, small_accessories, small_fit, small_garment};
use std::path::{Path, PathBuf};

fn corpus(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target)
}

#[test]
fn the_corpora_do_no_harm() {
    for (target, read) in TARGETS {
        let folder = corpus(target);
        let entries: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(entries.len() >= 20, "{} has {} inputs", folder.display(), entries.len());
        for path in entries {
            read(&std::fs::read(path).unwrap());
        }
    }
}

/// Inputs per target of packs, so many that all of them take some ten seconds; `KITSUKE_HOSTILE_INPUTS` asks for more.
const INPUTS: usize = 60_000;

/// The corpora of packs, changed as a fuzzer would change them, the same in every run.
#[test]
fn changed_inputs_of_packs_do_no_harm() {
    let inputs = std::env::var("KITSUKE_HOSTILE_INPUTS").map_or(INPUTS, |inputs| inputs.parse().unwrap());
    for (target, read) in TARGETS.into_iter().filter(|(target, _)| target.starts_with("pack")) {
        let mut paths: Vec<PathBuf> =
            std::fs::read_dir(corpus(target)).unwrap().map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        let known: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
        let mut numbers = Numbers(3);
        for _ in 0..inputs {
            let mut bytes = known[numbers.below(known.len())].clone();
            (0..=numbers.below(4)).for_each(|_| change(&mut bytes, &known, &mut numbers));
            read(&bytes);
        }
    }
}

/// Flips a bit, writes an extreme number, cuts the end off, takes bytes out, or puts a piece of another input in their place.
fn change(bytes: &mut Vec<u8>, known: &[Vec<u8>], numbers: &mut Numbers) {
    if bytes.is_empty() {
        return;
    }
    let at = numbers.below(bytes.len());
    let end = bytes.len().min(at + 1 + numbers.below(16));
    match numbers.below(6) {
        0 | 1 => bytes[at] ^= 1 << numbers.below(8),
        2 => {
            let extreme =
                [0, 1, 0x7fff_ffff, 0x8000_0000, u32::MAX, f32::NAN.to_bits()][numbers.below(6)].to_le_bytes();
            let length = extreme.len().min(bytes.len() - at).min(1 << numbers.below(3));
            bytes[at..at + length].copy_from_slice(&extreme[..length]);
        }
        3 => bytes.truncate(at),
        4 => drop(bytes.drain(at..end)),
        _ => {
            let other = &known[numbers.below(known.len())];
            let from = numbers.below(other.len() + 1);
            let to = other.len().min(from + numbers.below(64));
            bytes.splice(at..end, other[from..to].iter().copied());
        }
    }
}

#[test]
fn the_fuzzed_pack_has_every_section_that_is_written() {
    let whole = write_with(&small_garment(), &small_accessories(), Some(&small_fit())).unwrap();
    let tags = |pack: &Container| pack.sections.iter().map(|section| section.tag).collect::<Vec<_>>();
    let mut written = tags(&Container::of(&whole));
    // What compression lost is known of garments that the pipeline made.
    written.push(*b"LOSS");
    let fuzzed = tags(&SMALL_PACK);
    assert!(written.iter().all(|tag| fuzzed.contains(tag)), "{fuzzed:?} lacks some of {written:?}");
}

/// What the targets of packs begin with: whole small packs, and every section of the small one.
#[test]
#[ignore = "writes fuzz/corpus; to be run where the format changes, before fuzzing"]
fn write_the_seeds_of_packs() {
    let seed = |target: &str, name: &str, bytes: &[u8]| std::fs::write(corpus(target).join(name), bytes).unwrap();
    for target in ["pack", "pack_sections", "pack_fields"] {
        std::fs::create_dir_all(corpus(target)).unwrap();
    }
    seed("pack", "seed_small", &write(&small_garment()));
    let whole = write_with(&small_garment(), &small_accessories(), Some(&small_fit())).unwrap();
    seed("pack", "seed_whole", &whole);
    seed("pack", "seed_uncompressed", &Container::of(&whole).uncompressed().to_pack());
    let mut random: Vec<Vec<u8>> = (0..200).map(|seed| write(&random::garment(seed))).collect();
    random.sort_by_key(Vec::len);
    random.iter().take(3).enumerate().for_each(|(i, pack)| seed("pack", &format!("seed_random_{i}"), pack));

    let mut fields = 0;
    for (section, number) in SMALL_PACK.sections.iter().zip(0..) {
        let name = format!("seed_{}", String::from_utf8_lossy(&section.tag));
        let with = |number: u8| [&[number], section.stored.as_slice()].concat();
        seed("pack_sections", &name, &with(number));
        if FIELDS.contains(&section.tag) {
            seed("pack_fields", &name, &with(fields));
            fields += 1;
        }
    }
}
