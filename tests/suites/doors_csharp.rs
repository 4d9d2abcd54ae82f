//! The door for C# and Unity: the bindings compile with Debian's mono and give Rust's bits, the Unity layer compiles against a stub of
//! what it uses, and the package is whole. Where there is no mono, what is missing is named and its tests are passed over.

use kitsuke_tests::doors::{example, ffi_library, frames, inputs, repository, run};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Whether C# compiles and runs here, class libraries included.
fn has_mono(folder: &Path) -> bool {
    let source = folder.join("probe.cs");
    let text =
        "using System.Linq; class Probe { static void Main() { new[] { new System.Span<int>().Length }.Sum(); } }";
    fs::write(&source, text).unwrap();
    let succeeds = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let found = succeeds(Command::new("mcs").arg("-r:System.Core.dll").arg(&source))
        && succeeds(Command::new("mono").arg(source.with_extension("exe")));
    if !found {
        eprintln!(
            "skipped: C# needs apt-get install --no-install-recommends mono-mcs mono-runtime libmono-system-core4.0-cil"
        );
    }
    found
}

fn package() -> PathBuf {
    repository().join("runtime/unity")
}

/// All files and folders of a folder, sorted.
fn all_within(folder: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
        .into_iter()
        .flat_map(|path| if path.is_dir() { [vec![path.clone()], all_within(&path)].concat() } else { vec![path] })
        .collect()
}

fn sources(folder: &str) -> Vec<PathBuf> {
    let files = all_within(&package().join(folder)).into_iter();
    files.filter(|file| file.extension().is_some_and(|extension| extension == "cs")).collect()
}

/// Compiles these with the plain bindings; warnings are errors.
fn compiled(program: &Path, flags: &[&str], files: &[PathBuf]) {
    let mut mcs = Command::new("mcs");
    mcs.args(["-unsafe", "-warnaserror", "-optimize", "-r:System.Core.dll"]).args(flags);
    run(mcs.arg(format!("-out:{}", program.display())).args(sources("Runtime/Bindings")).args(files));
}

fn mono(program: &Path) -> Command {
    let mut mono = Command::new("mono");
    mono.env("LD_LIBRARY_PATH", ffi_library().parent().unwrap()).env("LC_ALL", "C.UTF-8").arg(program);
    mono
}

#[test]
fn a_csharp_program_gets_the_same_bits() {
    let (folder, pack, poses) = inputs();
    if !has_mono(folder.path()) {
        return;
    }
    let client = folder.path().join("client.exe");
    compiled(&client, &[], &[repository().join("tests/doors/Client.cs")]);
    let said = run(mono(&client).arg(folder.path()));
    assert!(fs::read(folder.path().join("frames.f32")).unwrap() == frames(&pack, &poses), "other bits than Rust's");
    insta::assert_snapshot!("csharp_client", said);
}

#[test]
fn the_example_in_csharp_runs() {
    let (folder, ..) = inputs();
    if !has_mono(folder.path()) {
        return;
    }
    let (source, program) = (folder.path().join("Example.cs"), folder.path().join("example.exe"));
    fs::write(&source, example("runtime/unity/README.md", "csharp")).unwrap();
    compiled(&program, &[], &[source]);
    insta::assert_snapshot!("csharp_example", run(mono(&program).current_dir(folder.path())));
}

/// Syntax, types and the members of Unity that are used; what they do, only Unity can show.
#[test]
fn the_unity_layer_compiles_against_a_stub() {
    let folder = tempfile::tempdir().unwrap();
    if !has_mono(folder.path()) {
        return;
    }
    let stub = vec![repository().join("tests/doors/UnityStub.cs")];
    let files = [sources("Runtime/Unity"), sources("Samples~"), stub].concat();
    // 649: fields that only Unity's inspector sets.
    compiled(&folder.path().join("unity.dll"), &["-target:library", "-nowarn:649"], &files);
}

/// The bindings have every function of the header but those for hosts without memory of their own.
#[test]
fn the_bindings_are_those_of_the_header() {
    let names = |text: &str| {
        let calls = text.split("kitsuke_").skip(1).filter_map(|rest| {
            let (name, _) = rest.split_once('(')?;
            name.chars().all(|c| c.is_ascii_lowercase() || c == '_').then(|| name.to_owned())
        });
        calls.collect::<std::collections::BTreeSet<_>>()
    };
    let read = |path: &str| fs::read_to_string(repository().join(path)).unwrap();
    let mut header = names(&read("runtime/ffi/include/kitsuke.h"));
    header.retain(|name| !name.starts_with("bytes_"));
    assert!(header.contains("evaluate") && header.contains("fitter_reach"));
    assert_eq!(header, names(&read("runtime/unity/Runtime/Bindings/Native.cs")));
    let abi = format!("const uint Abi = {};", kitsuke_abi_version());
    assert!(read("runtime/unity/Runtime/Bindings/Native.cs").contains(&abi), "the bindings follow another header");
}

fn kitsuke_abi_version() -> u32 {
    let header = fs::read_to_string(repository().join("runtime/ffi/include/kitsuke.h")).unwrap();
    let (_, rest) = header.split_once("#define KITSUKE_ABI_VERSION ").unwrap();
    rest.lines().next().unwrap().parse().unwrap()
}

/// Unity passes over what has no .meta file in a package; scenes find scripts by the numbers in them.
#[test]
fn the_package_is_whole() {
    let manifest: serde_json::Value =
        serde_json::from_slice(&fs::read(package().join("package.json")).unwrap()).unwrap();
    for sample in manifest["samples"].as_array().unwrap() {
        assert!(package().join(sample["path"].as_str().unwrap()).is_dir());
    }
    let assembly = fs::read(package().join("Runtime/Kitsuke.Runtime.asmdef")).unwrap();
    let assembly: serde_json::Value = serde_json::from_slice(&assembly).unwrap();
    assert_eq!(assembly["allowUnsafeCode"], true);

    let all = all_within(&package());
    let is_meta = |path: &Path| path.extension().is_some_and(|extension| extension == "meta");
    let mut guids = BTreeMap::new();
    for path in all.iter().filter(|path| !is_meta(path)) {
        let name = path.file_name().unwrap().to_str().unwrap();
        if name.ends_with('~') {
            continue;
        }
        let meta = fs::read_to_string(path.with_file_name(format!("{name}.meta")));
        let meta = meta.unwrap_or_else(|_| panic!("{} has no .meta file", path.display()));
        let guid = meta.lines().find_map(|line| line.strip_prefix("guid: ")).expect("a guid").to_owned();
        assert!(guid.len() == 32 && guid.chars().all(|c| c.is_ascii_hexdigit()));
        assert!(guids.insert(guid, path).is_none(), "{} has the guid of another file", path.display());
    }
    assert_eq!(all.iter().filter(|path| is_meta(path)).count(), guids.len(), "a .meta file of nothing");

    let scene = fs::read_to_string(package().join("Samples~/Komon/Komon.unity")).unwrap();
    let scripts = scene.lines().filter_map(|line| line.trim().strip_prefix("m_Script: "));
    let mut count = 0;
    for script in scripts {
        let guid = script.split_once("guid: ").unwrap().1.split(',').next().unwrap();
        assert!(guids.get(guid).is_some_and(|path| path.ends_with("Samples~/Komon/KomonSample.cs")));
        count += 1;
    }
    assert_eq!(count, 1);
}
