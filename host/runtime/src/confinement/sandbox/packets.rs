//! Packets between the supervisor and the inside of the sandbox: over a socket that keeps them
//! apart, some with descriptors.

use std::io::{IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{BorrowedFd, OwnedFd};

use rustix::io::Errno;
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer,
    SendAncillaryMessage, SendFlags, recvmsg, sendmsg,
};
use serde::{Deserialize, Serialize};

use super::{Refusal, Remark};

/// A message from inside the sandbox; each is one packet.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Packet {
    /// A layer was refused and the rest cannot stand as it is: try again without.
    Failed(Refusal),
    /// The tree stands; with it come descriptors of `/proc`, if it is a new one, and
    /// of the scratch folder.
    Ready(Vec<Refusal>),
    /// The plugin's process has locked itself, but for these, and with these remarks.
    Locked(Vec<Refusal>, Vec<Remark>),
    /// The plugin could not be started.
    CannotStart(String),
    /// A call that the sandbox itself needs failed.
    HostFailed(String),
    /// Nobody is left.
    Ended(Ended),
}

/// The end of the plugin's process, and the use of all processes.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) signal: Option<i32>,
    pub(crate) user_us: u64,
    pub(crate) system_us: u64,
    pub(crate) max_rss_kb: u64,
    pub(crate) voluntary_switches: u64,
    pub(crate) involuntary_switches: u64,
    pub(crate) minor_faults: u64,
    pub(crate) major_faults: u64,
}

/// Sends a packet; false when it could not be sent. Who waits for it sees then that nobody
/// speaks any more, if the sender ends.
#[must_use]
pub(super) fn send(link: &OwnedFd, packet: &Packet, descriptors: &[BorrowedFd<'_>]) -> bool {
    let Ok(text) = serde_json::to_vec(packet) else {
        return false;
    };
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = SendAncillaryBuffer::new(&mut space);
    if !descriptors.is_empty() {
        ancillary.push(SendAncillaryMessage::ScmRights(descriptors));
    }
    loop {
        match sendmsg(
            link,
            &[IoSlice::new(&text)],
            &mut ancillary,
            SendFlags::NOSIGNAL,
        ) {
            Err(Errno::INTR) => {}
            sent => return sent.is_ok(),
        }
    }
}

/// Waits for a packet; `None` when the other side is gone.
pub(super) fn receive(link: &OwnedFd) -> Option<(Packet, Vec<OwnedFd>)> {
    let mut text = vec![0; 1 << 16];
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(2))];
    let mut ancillary = RecvAncillaryBuffer::new(&mut space);
    let received = loop {
        let mut into = [IoSliceMut::new(&mut text)];
        match recvmsg(link, &mut into, &mut ancillary, RecvFlags::CMSG_CLOEXEC) {
            Err(Errno::INTR) => {}
            other => break other.ok()?,
        }
    };
    let mut descriptors = Vec::new();
    for message in ancillary.drain() {
        if let RecvAncillaryMessage::ScmRights(rights) = message {
            descriptors.extend(rights);
        }
    }
    let packet = serde_json::from_slice(&text[..received.bytes]).ok()?;
    Some((packet, descriptors))
}
