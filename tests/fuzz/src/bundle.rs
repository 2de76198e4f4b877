//! Bundles before they are zipped: archives that anybody may hand to somebody who repeats a suite.

use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use fleetyard_bench::bundle::{BundledFile, Manifest, Unpack, untar};
use fleetyard_core::InputError;

const SOURCE: &str = "bundle.tar";

/// Sizes of files by their names.
#[derive(Clone, Default)]
struct Sizes(Arc<Mutex<BTreeMap<String, u64>>>);

struct Size(Sizes, String);

impl Write for Size {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut sizes = self.0.0.lock().expect("nobody panicked");
        *sizes.get_mut(&self.1).expect("it was begun") += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Unpack for Sizes {
    fn begin(&mut self, _: &Manifest) -> Result<(), InputError> {
        assert!(self.0.lock().expect("nobody panicked").is_empty());
        Ok(())
    }

    fn file(&mut self, file: &BundledFile) -> Result<Box<dyn Write>, InputError> {
        let parts = || file.path.split('/');
        assert!(
            parts().all(|part| !matches!(part, "" | "." | "..")),
            "{file:?}"
        );
        assert!(!file.path.contains(char::is_control), "{file:?}");
        let mut sizes = self.0.lock().expect("nobody panicked");
        let before = sizes.insert(file.path.clone(), 0);
        assert_eq!(before, None, "a file is written twice");
        Ok(Box::new(Size(self.clone(), file.path.clone())))
    }
}

/// Unpacked files stay below their folder, come once, and are all that the manifest says; archives
/// that are refused are refused for a reason.
pub fn run(data: &[u8]) {
    let sizes = Sizes::default();
    match untar(SOURCE, data, &mut sizes.clone()) {
        Err(error) => {
            assert!(error.source.starts_with(SOURCE), "{error:?}");
            assert!(!error.reason.is_empty(), "{error:?}");
        }
        Ok((manifest, _)) => {
            let sizes = sizes.0.lock().expect("nobody panicked");
            let said = manifest
                .files
                .iter()
                .map(|file| (file.path.clone(), file.bytes));
            assert_eq!(*sizes, said.collect());
        }
    }
}
