//! Archives that somebody has made to do harm.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use flate2::Compression;
use flate2::write::GzEncoder;
use fleetyard_core::InputError;
use proptest::prelude::*;
use tar::{EntryType, Header};

use super::archive::digest_of;
use super::manifest::{BundledFile, Manifest, name_fault};
use super::{Bundle, Unpack, unpack, untar};

/// Files in memory.
#[derive(Default, Clone)]
struct Memory(Arc<Mutex<BTreeMap<String, Vec<u8>>>>);

struct Part(Memory, String);

impl Write for Part {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut files = self.0.0.lock().unwrap();
        files.entry(self.1.clone()).or_default().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Unpack for Memory {
    fn begin(&mut self, _: &Manifest) -> Result<(), InputError> {
        Ok(())
    }

    fn file(&mut self, file: &BundledFile) -> Result<Box<dyn Write>, InputError> {
        self.0.lock().unwrap().insert(file.path.clone(), Vec::new());
        Ok(Box::new(Part(self.clone(), file.path.clone())))
    }
}

fn file(path: &str, content: &[u8]) -> BundledFile {
    let (bytes, sha256) = digest_of(&mut &*content).unwrap();
    BundledFile {
        path: path.into(),
        bytes,
        sha256,
        executable: false,
    }
}

fn manifest(files: Vec<BundledFile>) -> Manifest {
    Manifest {
        suite: "s".into(),
        files,
        ..Manifest::empty()
    }
}

/// An archive of entries by kind, name and content; names may be anything.
fn archive(entries: &[(EntryType, &str, &[u8])]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (kind, name, content) in entries {
        let mut header = Header::new_ustar();
        let field = &mut header.as_mut_bytes()[..100];
        field[..name.len()].copy_from_slice(name.as_bytes());
        header.set_entry_type(*kind);
        header.set_mode(0o4777);
        header.set_uid(0);
        header.set_gid(0);
        header.set_mtime(0);
        header.set_size(content.len() as u64);
        if *kind != EntryType::Regular {
            header.set_link_name("/etc/passwd").unwrap();
        }
        header.set_cksum();
        bytes.extend(header.as_bytes());
        bytes.extend(*content);
        bytes.resize(bytes.len().next_multiple_of(512), 0);
    }
    bytes.resize(bytes.len() + 1024, 0);
    bytes
}

const MAP: (&str, &[u8]) = ("inputs/a.map", b"type octile");
const TEXT: (&str, &[u8]) = ("suite.toml", b"name = \"s\"");

/// The manifest of two files, and both in an archive that may be changed before.
fn with(change: impl FnOnce(&mut Manifest, &mut Vec<(EntryType, String, Vec<u8>)>)) -> Vec<u8> {
    let mut said = manifest(
        [MAP, TEXT]
            .map(|(name, content)| file(name, content))
            .to_vec(),
    );
    let mut entries: Vec<_> = [MAP, TEXT]
        .map(|(name, content)| (EntryType::Regular, format!("s/{name}"), content.to_vec()))
        .to_vec();
    change(&mut said, &mut entries);
    let text = said.text();
    let mut all: Vec<(EntryType, &str, &[u8])> =
        vec![(EntryType::Regular, "s/manifest.json", &text)];
    all.extend(
        entries
            .iter()
            .map(|(kind, name, content)| (*kind, &**name, &**content)),
    );
    archive(&all)
}

fn zipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[track_caller]
fn refused(bytes: &[u8], reason: &str) {
    let error = unpack("b.tar.gz", zipped(bytes).as_slice(), &mut Memory::default()).unwrap_err();
    assert!(error.to_string().contains(reason), "{error}");
    assert!(error.source.starts_with("b.tar.gz"), "{error}");
    assert!(error.hint.is_some(), "{error}");
}

#[test]
fn an_archive_is_read_as_it_was_written() {
    let memory = Memory::default();
    let bytes = zipped(&with(|_, _| {}));
    let said = unpack("b", bytes.as_slice(), &mut memory.clone()).unwrap();
    assert_eq!(said.files.len(), 2);
    let files = memory.0.lock().unwrap();
    assert_eq!(files[MAP.0], MAP.1);
    assert_eq!(files[TEXT.0], TEXT.1);
}

#[test]
fn what_could_leave_its_folder_is_refused() {
    for (name, reason) in [
        ("/etc/passwd", "begins at the root"),
        ("s/../../etc/passwd", "`.`, `..` or nothing"),
        ("s/./suite.toml", "`.`, `..` or nothing"),
        ("s//suite.toml", "`.`, `..` or nothing"),
        ("s/in\u{7}puts", "cannot be seen"),
        ("s/in\u{202e}puts", "cannot be seen"),
        ("other/suite.toml", "in another folder than the manifest"),
        ("s/none", "not in the manifest"),
        ("suite.toml", "is in no folder"),
        ("s/manifest.json", "is there twice"),
    ] {
        let bytes = with(|_, entries| entries[1].1 = name.to_owned());
        refused(&bytes, reason);
        // Nor may the manifest say so.
        let inside = name.strip_prefix("s/").unwrap_or(name);
        if let Some(reason) = name_fault(inside) {
            refused(&with(|said, _| said.files[1].path = inside.into()), reason);
        }
    }
    for (kind, reason) in [
        (EntryType::Symlink, "is a link"),
        (EntryType::Link, "is a link"),
        (EntryType::Char, "is a device"),
        (EntryType::Block, "is a device"),
        (EntryType::Fifo, "is a pipe"),
        (EntryType::Directory, "is a folder"),
        (EntryType::GNULongName, "is no plain file"),
        (EntryType::GNUSparse, "is no plain file"),
        (EntryType::XHeader, "is no plain file"),
        (EntryType::XGlobalHeader, "is no plain file"),
    ] {
        refused(&with(|_, entries| entries[0].0 = kind), reason);
    }
}

#[test]
fn what_the_manifest_does_not_say_is_refused() {
    refused(&with(|_, entries| entries[1].2[0] ^= 1), "SHA-256 differs");
    refused(
        &with(|_, entries| entries[1].2.push(b'\n')),
        "has 11 bytes, and the manifest says 10",
    );
    refused(
        &with(|_, entries| drop(entries.pop())),
        "lacks `suite.toml`",
    );
    let doubled =
        |entries: &mut Vec<(EntryType, String, Vec<u8>)>| entries.push(entries[0].clone());
    refused(&with(|_, entries| doubled(entries)), "is there twice");
    refused(
        &with(|said, _| said.files.push(said.files[0].clone())),
        "is there twice",
    );
    refused(
        &with(|said, _| said.files.push(file("suite.toml/x", b""))),
        "a file and a folder",
    );
    refused(&with(|said, _| said.files[0].bytes = u64::MAX), "GiB");
    refused(
        &with(|said, _| said.files[0].executable = true),
        "is no plugin",
    );
    refused(&with(|said, _| said.suite = "..".into()), "name of a suite");
    refused(
        &with(|said, _| said.suite = "t".into()),
        "not named after the suite",
    );
    refused(&archive(&[]), "the archive is empty");
    refused(
        &archive(&[(EntryType::Regular, "s/suite.toml", b"")]),
        "comes before the manifest",
    );
    refused(
        &archive(&[(EntryType::Regular, "s/manifest.json", b"{}")]),
        "format",
    );
    let whole = with(|_, _| {});
    let mut longer = whole.clone();
    longer.push(1);
    refused(&longer, "follows the end");
    // An end that is never reached.
    refused(
        &[whole.clone(), vec![0; 2 << 20]].concat(),
        "follows the end",
    );
    let mut twice = zipped(&whole);
    twice.extend(zipped(&whole));
    let error = unpack("b.tar.gz", twice.as_slice(), &mut Memory::default()).unwrap_err();
    assert!(error.reason.contains("follows the end"), "{error}");
}

#[test]
fn a_size_that_is_not_there_costs_nothing() {
    // A header says that a file has 8 GiB less a byte, and the manifest that it has 1 TiB.
    for bytes in [8 << 30, 1 << 40] {
        let mut claimed = with(|said, _| said.files[1].bytes = bytes - 1);
        let at = claimed
            .windows(12)
            .position(|name| name == b"s/suite.toml")
            .unwrap();
        let mut header = Header::from_byte_slice(&claimed[at..at + 512]).clone();
        header.set_size(bytes - 1);
        header.set_cksum();
        claimed[at..at + 512].copy_from_slice(header.as_bytes());
        let memory = Memory::default();
        let error = unpack("b", zipped(&claimed).as_slice(), &mut memory.clone()).unwrap_err();
        assert!(error.hint.is_some(), "{error}");
        let files = memory.0.lock().unwrap();
        assert!(files.values().map(Vec::len).sum::<usize>() < 1 << 16);
    }
}

#[test]
fn nothing_is_written_beside_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("b.tar.gz");
    let whole = zipped(&with(|_, _| {}));
    let into = folder.path().join("into");
    let names = |path: &std::path::Path| {
        let mut names: Vec<_> = fs::read_dir(path)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        names.sort();
        names
    };
    // However much of the archive is there.
    for end in (0..whole.len()).step_by(7) {
        fs::write(&place, &whole[..end]).unwrap();
        let error = Bundle::unpack(&place, &into).unwrap_err();
        assert!(error.to_string().contains("b.tar.gz"), "{error}");
        let _ = fs::remove_dir_all(&into);
        assert_eq!(names(folder.path()), ["b.tar.gz"]);
    }
    fs::write(&place, &whole).unwrap();
    let bundle = Bundle::unpack(&place, &into).unwrap();
    assert_eq!(names(&into), ["inputs", "manifest.json", "suite.toml"]);
    assert_eq!(Bundle::open(&into).unwrap().manifest, bundle.manifest);
    // A folder that is there is not written into.
    assert!(Bundle::unpack(&place, &into).is_err());
    // And a link in it is no file.
    fs::remove_file(into.join("suite.toml")).unwrap();
    std::os::unix::fs::symlink("/etc/passwd", into.join("suite.toml")).unwrap();
    let error = Bundle::open(&into).unwrap_err();
    assert!(error.reason.contains("no plain file"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// A changed archive unpacks to the files that its manifest says, or not at all.
    #[test]
    fn changed_archives_are_refused_or_whole(
        changes in prop::collection::vec((0usize..4096, any::<u8>()), 1..6),
        cut in 0usize..8192,
    ) {
        let mut bytes = with(|_, _| {});
        for (at, value) in changes {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        bytes.truncate(cut.max(1));
        let memory = Memory::default();
        match untar("b", bytes.as_slice(), &mut memory.clone()) {
            Err(error) => prop_assert!(!error.reason.is_empty()),
            Ok((said, _)) => {
                let files = memory.0.lock().unwrap();
                prop_assert_eq!(said.files.len(), files.len());
                for listed in &said.files {
                    prop_assert_eq!(listed, &file(&listed.path, &files[&listed.path]));
                }
            }
        }
    }
}
