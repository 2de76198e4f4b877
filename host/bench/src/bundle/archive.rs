//! The archive of a bundle: a gzipped tar whose bytes follow from its content, and the reading of
//! one that a stranger has made.
//!
//! The manifest comes first and says what else there is, with sizes and digests. Whatever is not
//! exactly so is refused: nothing but plain files, each once, below one folder, by names that stay
//! there. Nothing is taken from the archive's word but what the manifest repeats.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read, Write};

use flate2::bufread::GzDecoder;
use flate2::{Compression, GzBuilder};
use fleetyard_core::{InputError, shown};
use sha2::{Digest as _, Sha256};
use tar::{Archive, EntryType, Header};

use super::manifest::{BundledFile, MANIFEST, Manifest, name_fault};

/// The largest manifest that is read, in bytes.
pub(super) const MANIFEST_LIMIT: u64 = 64 << 20;

/// Most bytes after the end of an archive: zeros that fill its last block.
const PADDING: u64 = 1 << 20;

type Result<T> = std::result::Result<T, InputError>;

/// SHA-256 and length of what can be read.
pub(super) fn digest_of(reader: &mut dyn Read) -> io::Result<(u64, String)> {
    let mut hashed = Hashed::new(io::sink());
    let bytes = io::copy(reader, &mut hashed)?;
    Ok((bytes, hashed.sha256()))
}

/// Takes the digest of what is written through it.
struct Hashed<W> {
    hasher: Sha256,
    inner: W,
}

impl<W> Hashed<W> {
    fn new(inner: W) -> Self {
        Self {
            hasher: Sha256::new(),
            inner,
        }
    }

    /// In hexadecimal digits, as `sha256sum` prints it.
    fn sha256(self) -> String {
        use std::fmt::Write as _;
        let mut text = String::new();
        for byte in self.hasher.finalize() {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        text
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Writes a bundle: first the manifest, then the files in its order, each from its reader. Times,
/// owners and the name of the writer's machine are left out, so that equal content gives equal
/// bytes.
pub(super) fn write(
    to: &File,
    manifest: &Manifest,
    open: &mut dyn FnMut(&BundledFile) -> Result<Box<dyn Read>>,
) -> Result<()> {
    let failed = |error: io::Error| InputError::new("bundle", format!("cannot write: {error}"));
    let gzip = GzBuilder::new().write(to, Compression::default());
    let mut archive = tar::Builder::new(gzip);
    let text = manifest.text();
    let mut append = |name: &str, executable: bool, bytes: u64, content: &mut dyn Read| {
        let mut header = Header::new_ustar();
        header.set_entry_type(EntryType::Regular);
        header.set_mode(if executable { 0o755 } else { 0o644 });
        header.set_mtime(0);
        header.set_uid(0);
        header.set_gid(0);
        header.set_size(bytes);
        header.set_path(format!("{}/{name}", manifest.suite))?;
        header.set_cksum();
        archive.append(&header, content)
    };
    append(MANIFEST, false, text.len() as u64, &mut text.as_slice()).map_err(failed)?;
    for file in &manifest.files {
        let mut content = open(file)?;
        let mut hashed = HashedReader {
            hashed: Hashed::new(io::sink()),
            // Not a byte more than the header says.
            inner: (&mut content).take(file.bytes),
        };
        append(&file.path, file.executable, file.bytes, &mut hashed).map_err(failed)?;
        let mut more = [0];
        let sha256 = hashed.hashed.sha256();
        let ended = content.read(&mut more).map_err(failed)? == 0;
        if !ended || sha256 != file.sha256 {
            let reason = "the file was changed while the bundle was written";
            return Err(InputError::new(file.path.as_str(), reason).hint("try again"));
        }
    }
    let gzip = archive.into_inner().map_err(failed)?;
    gzip.finish().map_err(failed)?.sync_all().map_err(failed)
}

struct HashedReader<R> {
    hashed: Hashed<io::Sink>,
    inner: R,
}

impl<R: Read> Read for HashedReader<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let read = self.inner.read(to)?;
        self.hashed.hasher.update(&to[..read]);
        Ok(read)
    }
}

/// The receiver of a bundle's files.
pub trait Unpack {
    /// All that will come; an error ends the reading.
    fn begin(&mut self, manifest: &Manifest) -> Result<()>;
    /// A place for the next file, whose name stays below any folder.
    fn file(&mut self, file: &BundledFile) -> Result<Box<dyn Write>>;
}

/// Reads a gzipped bundle, `source` in errors.
pub fn unpack(source: &str, zipped: impl Read, to: &mut dyn Unpack) -> Result<Manifest> {
    let zipped = BufReader::new(zipped);
    let (manifest, gzip) = untar(source, GzDecoder::new(zipped), to)?;
    match gzip.into_inner().fill_buf() {
        Ok([]) => Ok(manifest),
        Ok(_) => Err(refused(source, "something follows the end of the archive")),
        Err(error) => Err(unreadable(source, &error)),
    }
}

/// Reads a bundle that is not zipped, up to its end.
pub fn untar<R: Read>(source: &str, tar: R, to: &mut dyn Unpack) -> Result<(Manifest, R)> {
    let mut archive = Archive::new(tar);
    let manifest = entries(source, &mut archive, to)?;
    let mut tar = archive.into_inner();
    let mut rest = 0;
    let mut buffer = vec![0; 1 << 14];
    loop {
        match tar.read(&mut buffer) {
            Ok(0) => return Ok((manifest, tar)),
            Ok(read) => {
                rest += read as u64;
                if rest > PADDING || buffer[..read].iter().any(|byte| *byte != 0) {
                    return Err(refused(source, "something follows the end of the archive"));
                }
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(unreadable(source, &error)),
        }
    }
}

fn entries<R: Read>(
    source: &str,
    archive: &mut Archive<R>,
    to: &mut dyn Unpack,
) -> Result<Manifest> {
    let mut state: Option<State> = None;
    // Raw: extensions of the format, which could be of any length, are entries of a kind that is
    // refused.
    let entries = archive.entries().map_err(|e| unreadable(source, &e))?;
    for (number, entry) in entries.raw(true).enumerate() {
        let mut entry = entry.map_err(|error| unreadable(source, &error))?;
        let name = entry.path_bytes().into_owned();
        let place = format!("entry {} (`{}`)", number + 1, lossy(&name));
        let fault = |what: &str| refused(source, &format!("{place} {what}"));
        match entry.header().entry_type() {
            EntryType::Regular => {}
            other => return Err(fault(in_words(other))),
        }
        let name = std::str::from_utf8(&name).map_err(|_| fault("has a name that is no UTF-8"))?;
        if let Some(what) = name_fault(name) {
            return Err(fault(what));
        }
        let size = entry.size();
        let Some((folder, name)) = name.split_once('/') else {
            return Err(fault("is in no folder"));
        };
        let Some(state) = &mut state else {
            if name != MANIFEST {
                return Err(fault("comes before the manifest"));
            }
            if size > MANIFEST_LIMIT {
                return Err(fault(&format!("has more than {MANIFEST_LIMIT} bytes")));
            }
            let mut text = Vec::new();
            entry
                .read_to_end(&mut text)
                .map_err(|error| unreadable(source, &error))?;
            let manifest = Manifest::read(&format!("{source}: {folder}/{MANIFEST}"), &text)?;
            if folder != manifest.suite {
                return Err(fault("is in a folder that is not named after the suite"));
            }
            to.begin(&manifest)?;
            let files = manifest.files.iter().cloned();
            state = Some(State {
                left: files.map(|file| (file.path.clone(), file)).collect(),
                manifest,
            });
            continue;
        };
        if folder != state.manifest.suite {
            return Err(fault("is in another folder than the manifest"));
        }
        let Some(file) = state.left.remove(name) else {
            let known = |file: &BundledFile| file.path == name;
            return Err(fault(
                if name == MANIFEST || state.manifest.files.iter().any(known) {
                    "is there twice"
                } else {
                    "is not in the manifest"
                },
            ));
        };
        if size != file.bytes {
            let bytes = file.bytes;
            return Err(fault(&format!(
                "has {size} bytes, and the manifest says {bytes}"
            )));
        }
        let mut written = Hashed::new(to.file(&file)?);
        let copied = io::copy(&mut entry, &mut written)
            .and_then(|bytes| written.flush().map(|()| bytes))
            .map_err(|error| unreadable(source, &error))?;
        if copied != file.bytes {
            return Err(fault("ends before its end"));
        }
        if written.sha256() != file.sha256 {
            return Err(fault("is not what the manifest says: its SHA-256 differs"));
        }
    }
    let Some(state) = state else {
        return Err(refused(source, "the archive is empty"));
    };
    if let Some(name) = state.left.keys().next() {
        let name = shown(name);
        let rest = match state.left.len() {
            1 => String::new(),
            count => format!(" and {} more", count - 1),
        };
        return Err(refused(source, &format!("lacks `{name}`{rest}")));
    }
    Ok(state.manifest)
}

/// A bundle while it is read.
struct State {
    manifest: Manifest,
    /// Files that have not come yet.
    left: BTreeMap<String, BundledFile>,
}

/// A name for people, as long as a line may be.
fn lossy(name: &[u8]) -> String {
    let text = String::from_utf8_lossy(name);
    let short: String = text.chars().take(100).collect();
    shown(&short)
}

fn in_words(kind: EntryType) -> &'static str {
    match kind {
        EntryType::Directory => "is a folder",
        EntryType::Symlink | EntryType::Link => "is a link",
        EntryType::Char | EntryType::Block => "is a device",
        EntryType::Fifo => "is a pipe",
        _ => "is no plain file",
    }
}

fn refused(source: &str, reason: &str) -> InputError {
    InputError::new(source, reason).hint(
        "a bundle is an archive as `fleetyard store bundle` writes it: this one was changed, or is \
         another one",
    )
}

fn unreadable(source: &str, error: &io::Error) -> InputError {
    InputError::new(source, format!("cannot be unpacked: {error}"))
        .hint("the archive is damaged, or no gzipped tar")
}
