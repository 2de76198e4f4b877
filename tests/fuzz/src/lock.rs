//! Lock files, which anybody may hand to a host.

use std::path::Path;

use fleetyard_runtime::Lock;

/// A lock that can be read is the same when it is written and read again; one that
/// cannot says where and why.
pub fn run(data: &[u8]) {
    let file = Path::new("fleetyard.lock");
    let lock = match Lock::parse(data, file) {
        Ok(lock) => lock,
        Err(error) => return super::check_error(&error, "fleetyard.lock", data),
    };
    let written = lock.content().expect("a lock can be written");
    let again = Lock::parse(&written, file).expect("what was written");
    assert_eq!(again.pinned().len(), lock.pinned().len());
    assert_eq!(again.content().expect("the same"), written);
    for entry in lock.pinned() {
        assert!(!entry.code.is_empty());
        // Against itself it is unchanged, against nothing it is not.
        let code: Vec<_> = entry
            .code
            .iter()
            .map(|code| fleetyard_runtime::CodeFile {
                path: lock.locate(&code.path),
                ..code.clone()
            })
            .collect();
        assert!(lock.check(entry, &code).is_ok());
        assert!(lock.check(entry, &[]).is_err());
    }
}
