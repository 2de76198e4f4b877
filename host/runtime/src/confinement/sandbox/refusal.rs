//! Refusals: layers that the kernel does not give, and by which error.

use rustix::io::Errno;
use serde::{Deserialize, Serialize};

use super::report::Layer;

/// A layer that was refused, and by which error.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Refusal {
    pub(crate) layer: Layer,
    pub(crate) errno: i32,
    pub(crate) reason: String,
}

impl Refusal {
    pub(crate) fn new(layer: Layer, errno: Errno, reason: impl Into<String>) -> Self {
        Self {
            layer,
            errno: errno.raw_os_error(),
            reason: reason.into(),
        }
    }

    /// For `map_err`: the layer, and what was being done.
    pub(crate) fn of(layer: Layer, what: &str) -> impl Fn(Errno) -> Self + '_ {
        move |errno| Self::new(layer, errno, what)
    }
}

/// A gap of a layer that is active.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Remark {
    pub(crate) layer: Layer,
    pub(crate) text: String,
}

/// The name of an error number, as in the manual.
pub(crate) fn errno_name(errno: i32) -> String {
    let name = match errno {
        libc::EPERM => "EPERM",
        libc::ENOENT => "ENOENT",
        libc::EIO => "EIO",
        libc::E2BIG => "E2BIG",
        libc::EAGAIN => "EAGAIN",
        libc::ENOMEM => "ENOMEM",
        libc::EACCES => "EACCES",
        libc::EBUSY => "EBUSY",
        libc::EEXIST => "EEXIST",
        libc::ENODEV => "ENODEV",
        libc::ENOTDIR => "ENOTDIR",
        libc::EINVAL => "EINVAL",
        libc::EMFILE => "EMFILE",
        libc::ENOSPC => "ENOSPC",
        libc::EROFS => "EROFS",
        libc::ELOOP => "ELOOP",
        libc::ENOSYS => "ENOSYS",
        libc::EUSERS => "EUSERS",
        libc::EOPNOTSUPP => "EOPNOTSUPP",
        libc::EOVERFLOW => "EOVERFLOW",
        _ => return format!("errno {errno}"),
    };
    name.to_owned()
}

/// The error number of an error, if it has one.
pub(super) fn as_errno(error: &std::io::Error) -> Errno {
    error
        .raw_os_error()
        .map_or(Errno::IO, Errno::from_raw_os_error)
}
