//! Whole files in and out: bounded reading with helpful errors, and writing
//! that never leaves half a file behind.

use std::borrow::Cow;
use std::fs::{self, File, FileType, TryLockError};
use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{AtFlags, CWD, Mode, OFlags, fcntl_getfl, fcntl_setfl};

use crate::InputError;

/// Descriptors that a shell hands over by name: standard input, and process substitution.
const HANDED_OVER: [&str; 3] = ["/dev/stdin", "/dev/fd", "/proc/self/fd"];

/// The application id of this program's stores, in the header of their SQLite files.
pub const STORE_MARK: [u8; 4] = *b"FlYd";

/// The first bytes of every SQLite file.
pub const SQLITE_MAGIC: &[u8] = b"SQLite format 3\0";

/// Opens a file to be read, and nothing that somebody else may keep waiting: pipes and
/// devices are refused, but for those that a shell hands over (`/dev/stdin`, `<(…)`).
pub fn open_input(path: &Path) -> Result<File, InputError> {
    open(
        path,
        HANDED_OVER.iter().any(|meant| path.starts_with(meant)),
    )
}

/// Opens a file to be read from any place in it: no pipe will do.
pub fn open_regular(path: &Path) -> Result<File, InputError> {
    open(path, false)
}

fn open(path: &Path, streams: bool) -> Result<File, InputError> {
    let failed = |error: io::Error| read_error(path, &error);
    // Opening a pipe waits for who writes it, unless told not to.
    let file = File::options()
        .read(true)
        .custom_flags(OFlags::NONBLOCK.bits().cast_signed())
        .open(path)
        .map_err(failed)?;
    let kind = file.metadata().map_err(failed)?.file_type();
    if kind.is_dir() {
        let name = path.display().to_string();
        return Err(InputError::new(name, "this is a folder, not a file")
            .hint("name a file inside the folder"));
    }
    if !kind.is_file() && !streams {
        let reason = format!("this is {}, not a file", in_words(kind));
        return Err(InputError::new(path.display().to_string(), reason).hint(
            "name a regular file; `/dev/stdin` and `<(…)` hand over a stream where one will do",
        ));
    }
    wait_again(&file).map_err(failed)?;
    Ok(file)
}

/// Opens a file to be written from its beginning. Devices and pipes are written as they
/// are; a pipe that nobody reads is refused, and so is a disk.
pub fn create_output(path: &Path) -> io::Result<File> {
    let file = File::options()
        .write(true)
        .create(true)
        .custom_flags(OFlags::NONBLOCK.bits().cast_signed())
        .open(path)
        .map_err(|error| match rustix::io::Errno::from_io_error(&error) {
            Some(rustix::io::Errno::NXIO) => io::Error::other("nobody reads this pipe"),
            _ => error,
        })?;
    let kind = file.metadata()?.file_type();
    if kind.is_block_device() {
        return Err(io::Error::other("this is a disk, not a file"));
    }
    wait_again(&file)?;
    if kind.is_file() {
        file.set_len(0)?;
    }
    Ok(file)
}

/// From here on reading and writing waits.
fn wait_again(file: &File) -> io::Result<()> {
    let flags = fcntl_getfl(file)?;
    Ok(fcntl_setfl(file, flags.difference(OFlags::NONBLOCK))?)
}

fn in_words(kind: FileType) -> &'static str {
    match kind {
        _ if kind.is_fifo() => "a pipe",
        _ if kind.is_socket() => "a socket",
        _ => "a device",
    }
}

/// Reads a text file of at most `limit` bytes, without its byte order mark ([`unmarked`]): whatever
/// reads text from a disk reads it through here.
///
/// A missing file's error names the sibling whose name is nearest.
pub fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, InputError> {
    let name = path.display().to_string();
    let failed = |error: &io::Error| read_error(path, error);
    let file = open_input(path)?;
    let meta = file.metadata().map_err(|error| failed(&error))?;
    let mut bytes = Vec::new();
    if meta.len() <= limit {
        // The length is a guess (a pipe has none); `take` below is the guard.
        bytes
            .try_reserve(meta.len() as usize)
            .map_err(|_| InputError::new(name.as_str(), "the file does not fit into memory"))?;
        file.take(limit.saturating_add(1))
            .read_to_end(&mut bytes)
            .map_err(|error| failed(&error))?;
    }
    if meta.len() > limit || bytes.len() as u64 > limit {
        return Err(InputError::new(
            name,
            format!("the file is larger than the limit of {limit} bytes"),
        ));
    }
    let mark = bytes.len() - unmarked(&name, &bytes)?.len();
    bytes.drain(..mark);
    Ok(bytes)
}

/// A text without the byte order mark that Windows puts before UTF-8. Other encodings are an error
/// that names them; `source` is the text's name in it.
pub fn unmarked<'a>(source: &str, bytes: &'a [u8]) -> Result<&'a [u8], InputError> {
    let encoding = match bytes {
        [0xef, 0xbb, 0xbf, text @ ..] => return Ok(text),
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => "UTF-32",
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "UTF-16",
        // Without a mark every other byte of a plain text is 0, which no text in UTF-8 has.
        [a, 0, b, 0, ..] | [0, a, 0, b, ..] if *a != 0 && *b != 0 => "UTF-16",
        _ => return Ok(bytes),
    };
    let reason = format!("the file is text in {encoding}, and UTF-8 is read");
    Err(InputError::new(source, reason).hint(format!(
        "save it as UTF-8, or run `iconv -f {encoding} -t UTF-8 OLD > NEW`"
    )))
}

/// Reads a file of at most `limit` bytes and parses it; errors name the file.
pub fn load_file<T>(
    path: impl AsRef<Path>,
    limit: u64,
    parse: impl FnOnce(&str, &[u8]) -> Result<T, InputError>,
) -> Result<T, InputError> {
    let path = path.as_ref();
    let bytes = read_file(path, limit)?;
    parse(&path.display().to_string(), &bytes)
}

fn read_error(path: &Path, error: &io::Error) -> InputError {
    let name = path.display().to_string();
    match error.kind() {
        io::ErrorKind::NotFound => {
            InputError::new(name, "no such file").maybe_hint(missing_hint(path))
        }
        io::ErrorKind::PermissionDenied => InputError::new(name, "permission denied")
            .hint("check who may read the file and its folder"),
        _ => InputError::new(name, format!("cannot read: {error}")),
    }
}

/// A hint for a user who named a missing file: names that are similar.
pub fn missing_hint(path: &Path) -> Option<String> {
    /// Folders with more entries are not searched to the end.
    const LISTED: usize = 10_000;
    let folder = folder_of(path);
    let wanted = path.file_name()?.to_str()?;
    let Ok(entries) = fs::read_dir(&folder) else {
        return Some(format!("the folder {} does not exist", folder.display()));
    };
    let nearest = entries
        .take(LISTED)
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .map(|name| (strsim::damerau_levenshtein(wanted, &name), name))
        .filter(|(distance, _)| *distance * 3 <= wanted.chars().count())
        .min()?;
    Some(format!(
        "did you mean {}?",
        folder.join(nearest.1).display()
    ))
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Writes a file as a whole or not at all: the bytes go to a file without a name in the
/// same folder, which then takes it. Where a file system has no such files, and for the
/// moment in which an old file is replaced, it has a temporary name; what a killed process
/// leaves of that is removed when the same file is written again.
///
/// A reader sees the old content or the new, never a part. Existing permissions
/// of a replaced file are kept.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), InputError> {
    write_all_atomically(&[(path, bytes)])
}

/// Writes several files, each as a whole. No file is replaced before the content of
/// all is on the disk, so that what can go wrong mostly goes wrong before.
pub fn write_all_atomically(files: &[(&Path, &[u8])]) -> Result<(), InputError> {
    let staged: Vec<Staged> = files
        .iter()
        .map(|(path, bytes)| Staged::new(path, bytes))
        .collect::<Result<_, _>>()?;
    staged.into_iter().try_for_each(Staged::commit)
}

/// The content of a file that does not have its name yet.
struct Staged {
    /// As the user named it.
    path: PathBuf,
    target: PathBuf,
    content: Content,
}

enum Content {
    /// It is where it belongs.
    There,
    /// In a file without a name: nothing of it is left, however this process ends.
    Unnamed(File),
    /// In a file with a temporary name, locked as long as somebody needs it.
    Temporary(File, PathBuf),
}

impl Staged {
    fn new(path: &Path, bytes: &[u8]) -> Result<Self, InputError> {
        if path.file_name().is_none() {
            return Err(InputError::new(
                path.display().to_string(),
                "this does not name a file",
            ));
        }
        let failed = |error: io::Error| write_error(path, &error);
        let mut staged = Self {
            path: path.to_owned(),
            target: path.to_owned(),
            content: Content::There,
        };
        // A device or a pipe (`/dev/stdout`) cannot be replaced by renaming.
        let old = fs::metadata(path).ok();
        if old.as_ref().is_some_and(fs::Metadata::is_dir) {
            return Err(write_error(path, &io::ErrorKind::IsADirectory.into()));
        }
        if old.as_ref().is_some_and(|meta| !meta.is_file()) {
            create_output(path)
                .and_then(|mut file| file.write_all(bytes))
                .map_err(failed)?;
            return Ok(staged);
        }
        // Through a symbolic link, the file it points to is replaced.
        if let Ok(target) = fs::canonicalize(path) {
            staged.target = target;
        }
        staged.remove_abandoned();
        // From here on, dropping it removes what has a temporary name.
        staged.content = match unnamed(&folder_of(&staged.target)) {
            Some(file) => Content::Unnamed(file),
            None => staged.temporary(create_locked).map_err(failed)?,
        };
        let (Content::Unnamed(file) | Content::Temporary(file, _)) = &mut staged.content else {
            return Ok(staged);
        };
        let written = (|| {
            file.write_all(bytes)?;
            if let Some(meta) = old {
                file.set_permissions(meta.permissions())?;
            }
            file.sync_all()
        })();
        written.map_err(failed)?;
        Ok(staged)
    }

    fn commit(mut self) -> Result<(), InputError> {
        self.take_name()
            .map_err(|error| write_error(&self.path, &error))
    }

    fn take_name(&mut self) -> io::Result<()> {
        if let Content::Unnamed(file) = &self.content {
            match name(file, &self.target) {
                // Nothing was there that would have to be replaced.
                Ok(()) => {
                    self.content = Content::There;
                    return Ok(());
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
            // Nobody else takes it for abandoned.
            let _ = file.try_lock();
            self.content = self.temporary(|path| {
                name(file, path)?;
                file.try_clone()
            })?;
        }
        if let Content::Temporary(_, temporary) = &self.content {
            fs::rename(temporary, &self.target)?;
        }
        self.content = Content::There;
        Ok(())
    }

    /// The temporary names that the file may have.
    fn temporary_names(&self) -> impl Iterator<Item = PathBuf> + use<> {
        /// Most processes that write one file at the same time.
        const MOST: usize = 256;
        let file_name = self.target.file_name().unwrap_or_default().to_owned();
        let folder = folder_of(&self.target);
        (0..MOST).map(move |number| {
            let mut name = std::ffi::OsString::from(".");
            name.push(&file_name);
            name.push(format!(".{number}.tmp"));
            folder.join(name)
        })
    }

    /// Makes a file under the first temporary name that is free.
    fn temporary(&self, make: impl Fn(&Path) -> io::Result<File>) -> io::Result<Content> {
        for path in self.temporary_names() {
            match make(&path) {
                Ok(file) => return Ok(Content::Temporary(file, path)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// Removes what processes that were killed have left of the file.
    fn remove_abandoned(&self) {
        for path in self.temporary_names() {
            // Whatever else somebody has put there is not ours.
            let Ok(file) = open_regular(&path) else {
                return;
            };
            // Whoever is writing it has it locked.
            if file.try_lock().is_ok() && is_at(&file, &path) {
                let _ = fs::remove_file(&path);
            }
        }
    }
}

/// A file without a name, where the system has them.
fn unnamed(folder: &Path) -> Option<File> {
    let flags = OFlags::TMPFILE | OFlags::WRONLY | OFlags::CLOEXEC;
    let file = rustix::fs::open(folder, flags, Mode::from_raw_mode(0o666)).ok()?;
    let file = File::from(file);
    // It gets its name through there.
    Path::new(&by_descriptor(&file)).exists().then_some(file)
}

fn by_descriptor(file: &File) -> String {
    format!("/proc/self/fd/{}", file.as_raw_fd())
}

/// Gives a file a name that is free.
fn name(file: &File, path: &Path) -> io::Result<()> {
    let from = by_descriptor(file);
    rustix::fs::linkat(CWD, from, CWD, path, AtFlags::SYMLINK_FOLLOW)?;
    Ok(())
}

/// Makes a file that nobody takes for abandoned.
fn create_locked(path: &Path) -> io::Result<File> {
    let file = File::create_new(path)?;
    // Where nothing can be locked, nothing is removed either.
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) || !is_at(&file, path) {
        // Somebody was faster, and removes it.
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    Ok(file)
}

/// True if the name still belongs to the file.
fn is_at(file: &File, path: &Path) -> bool {
    let identity = |meta: fs::Metadata| (meta.dev(), meta.ino());
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(file), Ok(there)) => identity(file) == identity(there),
        _ => false,
    }
}

impl Drop for Staged {
    fn drop(&mut self) {
        if let Content::Temporary(_, temporary) = &self.content {
            // Best effort: the error that is reported is the one that matters.
            let _ = fs::remove_file(temporary);
        }
    }
}

fn write_error(path: &Path, error: &io::Error) -> InputError {
    let base = InputError::new(path.display().to_string(), format!("cannot write: {error}"));
    match error.kind() {
        io::ErrorKind::NotFound => base.hint("the folder does not exist; create it first"),
        io::ErrorKind::PermissionDenied => base.hint("check who may write in the folder"),
        _ => base,
    }
}

/// A file's name without folders and extension, for `/` and `\` alike: scenario
/// files written elsewhere carry either.
pub(crate) fn stem(path: &str) -> &str {
    let name = path.rsplit(['/', '\\']).next().unwrap_or(path);
    match name.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem,
        _ => name,
    }
}

/// Refuses a text whose lines end as on the first Macs: it would be one line.
pub(crate) fn check_line_ends(source: &str, bytes: &[u8]) -> Result<(), InputError> {
    let begins = &bytes[..bytes.len().min(1 << 16)];
    if begins.contains(&b'\n') || !begins.trim_ascii_end().contains(&b'\r') {
        return Ok(());
    }
    let reason = "the lines end with carriage returns alone, as on old Macs";
    Err(InputError::new(source, reason)
        .at_line(1)
        .hint("save it with line ends of Unix or Windows, or run `tr '\\r' '\\n' < OLD > NEW`"))
}

/// Lines of a text file with their numbers from 1, without `\n` and `\r\n`.
pub(crate) struct Lines<'a> {
    rest: Option<&'a [u8]>,
    number: u64,
}

impl<'a> Lines<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        let rest = (!bytes.is_empty()).then_some(bytes);
        Self { rest, number: 0 }
    }

    /// Number of the line that would come next.
    pub(crate) fn next_number(&self) -> u64 {
        self.number + 1
    }

    /// True if nothing but blank lines is left.
    pub(crate) fn only_blank_left(&self) -> bool {
        self.rest
            .is_none_or(|rest| rest.iter().all(u8::is_ascii_whitespace))
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (u64, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.rest?;
        let line = if let Some(at) = rest.iter().position(|byte| *byte == b'\n') {
            self.rest = Some(&rest[at + 1..]).filter(|rest| !rest.is_empty());
            &rest[..at]
        } else {
            self.rest = None;
            rest
        };
        self.number += 1;
        Some((self.number, line.strip_suffix(b"\r").unwrap_or(line)))
    }
}

/// The column, in characters from 1, of the byte at `at`.
pub(crate) fn column(line: &[u8], at: usize) -> u64 {
    let before = &line[..at.min(line.len())];
    String::from_utf8_lossy(before).chars().count() as u64 + 1
}

/// Characters that have no look of their own and change that of others, or are obeyed by a
/// terminal: the general categories Cc (control), Cf (format), Zl and Zp (line and paragraph
/// separators), and what else Unicode says to be ignorable by default (16.0,
/// `UnicodeData.txt` and `DerivedCoreProperties.txt`). Marks that turn the direction of text
/// are among them, and joiners of no width.
pub fn is_unseen(c: char) -> bool {
    const UNSEEN: [(char, char); 25] = [
        ('\u{ad}', '\u{ad}'),
        ('\u{34f}', '\u{34f}'),
        ('\u{600}', '\u{605}'),
        ('\u{61c}', '\u{61c}'),
        ('\u{6dd}', '\u{6dd}'),
        ('\u{70f}', '\u{70f}'),
        ('\u{890}', '\u{891}'),
        ('\u{8e2}', '\u{8e2}'),
        ('\u{115f}', '\u{1160}'),
        ('\u{17b4}', '\u{17b5}'),
        ('\u{180b}', '\u{180f}'),
        ('\u{200b}', '\u{200f}'),
        ('\u{2028}', '\u{202e}'),
        ('\u{2060}', '\u{206f}'),
        ('\u{3164}', '\u{3164}'),
        ('\u{fe00}', '\u{fe0f}'),
        ('\u{feff}', '\u{feff}'),
        ('\u{ffa0}', '\u{ffa0}'),
        ('\u{fff0}', '\u{fffb}'),
        ('\u{110bd}', '\u{110bd}'),
        ('\u{110cd}', '\u{110cd}'),
        ('\u{13430}', '\u{1343f}'),
        ('\u{1bca0}', '\u{1bca3}'),
        ('\u{1d173}', '\u{1d17a}'),
        // Tags, and the variation selectors beyond the first sixteen.
        ('\u{e0000}', '\u{e0fff}'),
    ];
    // Most text is none of this.
    c.is_control()
        || c > '\u{a0}'
            && UNSEEN
                .iter()
                .any(|(first, last)| (*first..=*last).contains(&c))
}

/// Text from outside, the name of a file among it, as a part of one line: what would end the line or is not
/// seen is escaped.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unseen) {
        return Cow::Borrowed(text);
    }
    let mut line = String::with_capacity(text.len());
    for letter in text.chars() {
        if is_unseen(letter) {
            line.extend(letter.escape_default());
        } else {
            line.push(letter);
        }
    }
    Cow::Owned(line)
}

/// Text from outside for a message: escaped, and cut when it is long.
pub fn shown(text: &str) -> String {
    cut(text, 60)
}

/// The same for bytes, in quotes.
pub(crate) fn quote(bytes: &[u8]) -> String {
    format!("'{}'", cut(&String::from_utf8_lossy(bytes), 40))
}

/// At most so many characters of a text, escaped.
pub(crate) fn cut(text: &str, longest: usize) -> String {
    let mut cut: String = text
        .chars()
        .take(longest)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().nth(longest).is_some() {
        cut.push('…');
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_read_where_a_shell_handed_it_over() {
        let (reader, mut writer) = io::pipe().unwrap();
        writer.write_all(b"type octile").unwrap();
        drop(writer);
        let path = PathBuf::from(format!("/proc/self/fd/{}", reader.as_raw_fd()));
        if !path.exists() {
            return;
        }
        assert_eq!(
            open_regular(&path).unwrap_err().reason,
            "this is a pipe, not a file"
        );
        assert_eq!(read_file(&path, 100).unwrap(), b"type octile");
    }

    #[test]
    fn a_device_is_no_file() {
        let error = read_file(Path::new("/dev/zero"), 100).unwrap_err();
        assert_eq!(error.reason, "this is a device, not a file");
        assert!(error.hint.is_some());
        // Writing to one may be meant.
        write_atomically(Path::new("/dev/null"), b"text").unwrap();
    }

    #[test]
    fn a_pipe_that_nobody_reads_is_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &path, mode).unwrap();
        let error = write_atomically(&path, b"text").unwrap_err();
        assert_eq!(error.reason, "cannot write: nobody reads this pipe");
        assert_eq!(
            read_file(&path, 100).unwrap_err().reason,
            "this is a pipe, not a file"
        );
        let reader = open(&path, true).unwrap();
        write_atomically(&path, b"text").unwrap();
        let mut read = String::new();
        (&reader).take(4).read_to_string(&mut read).unwrap();
        assert_eq!(read, "text");
    }

    #[test]
    fn byte_order_marks_are_left_out_and_other_encodings_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.map");
        for (bytes, expected) in [
            (&b"\xef\xbb\xbftype"[..], Ok(&b"type"[..])),
            (b"\xef\xbb\xbf", Ok(b"")),
            (b"type", Ok(b"type")),
            (b"", Ok(b"")),
            (b"\xff\xfet\0", Err("UTF-16")),
            (b"\xfe\xff\0t", Err("UTF-16")),
            (b"t\0y\0", Err("UTF-16")),
            (b"\0t\0y", Err("UTF-16")),
            (b"\xff\xfe\0\0t\0\0\0", Err("UTF-32")),
        ] {
            fs::write(&path, bytes).unwrap();
            let read = read_file(&path, 100);
            match expected {
                Ok(text) => assert_eq!(read.as_deref(), Ok(text)),
                Err(encoding) => {
                    let error = read.unwrap_err();
                    assert!(error.reason.contains(encoding), "{error}");
                    assert!(error.hint.unwrap().contains("save it as UTF-8"));
                }
            }
        }
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn what_killed_processes_left_goes_when_the_file_is_written_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.json");
        for number in 0..3 {
            let name = format!(".out.json.{number}.tmp");
            fs::write(folder.path().join(name), "half").unwrap();
        }
        // Somebody is still writing this one, and that one is of another file.
        let busy = File::open(folder.path().join(".out.json.1.tmp")).unwrap();
        busy.lock().unwrap();
        fs::write(folder.path().join(".other.json.0.tmp"), "half").unwrap();
        for text in ["one", "two"] {
            write_atomically(&path, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
            let left = [".other.json.0.tmp", ".out.json.1.tmp", "out.json"];
            assert_eq!(names(folder.path()), left);
        }
    }

    #[test]
    fn a_file_that_is_not_committed_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.json");
        fs::write(&path, "old").unwrap();
        drop(Staged::new(&path, b"new").unwrap());
        // As where no file is without a name.
        let mut staged = Staged::new(&path, b"").unwrap();
        staged.content = staged.temporary(create_locked).unwrap();
        assert_eq!(names(folder.path()), [".out.json.0.tmp", "out.json"]);
        drop(staged);
        assert_eq!(names(folder.path()), ["out.json"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    }

    #[test]
    fn many_writers_of_one_file_leave_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        std::thread::scope(|scope| {
            for writer in 0..8_u8 {
                let path = &path;
                scope.spawn(move || {
                    for _ in 0..50 {
                        write_atomically(path, &[writer; 4096]).unwrap();
                    }
                });
            }
        });
        assert_eq!(names(folder.path()), ["out"]);
        let bytes = fs::read(&path).unwrap();
        assert!(bytes.len() == 4096 && bytes.iter().all(|byte| *byte == bytes[0]));
    }

    #[test]
    fn what_changes_the_look_of_text_is_told_from_text() {
        // Overrides and isolates of direction, joiners, separators, tags, fillers.
        for c in "\u{202a}\u{202e}\u{2066}\u{2069}\u{61c}\u{200b}\u{200f}\u{feff}\u{ad}\u{2028}\
                  \u{2029}\u{e0041}\u{e007f}\u{3164}\u{9b}\u{1b}\u{7f}\n"
            .chars()
        {
            assert!(is_unseen(c), "{}", c.escape_unicode());
        }
        for c in "aé ß\u{a0}中Ж٣−→█\u{301}🤖".chars() {
            assert!(!is_unseen(c), "{}", c.escape_unicode());
        }
    }
}
