//! The user at the other end of a connection on this machine.
//!
//! Every user of the machine can read the command line of a browser, and with it the address with the
//! ticket. So a connection from this machine has to belong to the user of the studio, or to root: the
//! kernel lists the owner of each socket in `/proc/net` (proc_pid_net(5)).

use std::fs;
use std::net::{IpAddr, SocketAddr};

/// The owner of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Peer {
    /// A user's of this machine.
    User(u32),
    /// Nobody's any more: whoever made it has closed it.
    Gone,
    /// It comes from elsewhere, or the kernel does not say.
    Unknown,
}

/// The owner of the connection from `peer` to `here`.
pub(crate) fn of(peer: SocketAddr, here: SocketAddr) -> Peer {
    if !peer.ip().to_canonical().is_loopback() {
        return Peer::Unknown;
    }
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"];
    let tables: Vec<String> = tables
        .iter()
        .filter_map(|table| fs::read_to_string(table).ok())
        .collect();
    // A table has its heading, at least.
    if tables.iter().all(|table| table.lines().count() < 2) {
        return Peer::Unknown;
    }
    let found = tables.iter().find_map(|table| listed(table, peer, here));
    found.unwrap_or(Peer::Gone)
}

/// The row of a table for the socket at the other end.
fn listed(table: &str, peer: SocketAddr, here: SocketAddr) -> Option<Peer> {
    let (local, remote) = (names(peer), names(here));
    table.lines().skip(1).find_map(|line| {
        let mut fields = line.split_ascii_whitespace().skip(1);
        let is = |field: Option<&str>, names: &[String; 2]| {
            field.is_some_and(|field| names.iter().any(|name| name == field))
        };
        if !is(fields.next(), &local) || !is(fields.next(), &remote) {
            return None;
        }
        // State, queues, timer, retransmissions; then the user, a timeout and the file.
        let user = fields.nth(4)?.parse().ok()?;
        let file: u64 = fields.nth(1)?.parse().ok()?;
        // A socket without a file has lost its user, and is listed as root's.
        Some(if file == 0 {
            Peer::Gone
        } else {
            Peer::User(user)
        })
    })
}

/// An address as the tables have it, and as the one for IPv6 has it: words in the machine's order.
fn names(address: SocketAddr) -> [String; 2] {
    let word = |bytes: &[u8]| {
        let bytes = bytes.try_into().unwrap_or_default();
        format!("{:08X}", u32::from_ne_bytes(bytes))
    };
    let port = address.port();
    let mapped = match address.ip() {
        IpAddr::V4(ip) => ip.to_ipv6_mapped(),
        IpAddr::V6(ip) => ip,
    };
    let six: String = mapped.octets().chunks(4).map(word).collect();
    let short = match address.ip().to_canonical() {
        IpAddr::V4(ip) => word(&ip.octets()),
        IpAddr::V6(_) => six.clone(),
    };
    [format!("{short}:{port:04X}"), format!("{six}:{port:04X}")]
}

#[cfg(test)]
mod tests {
    use std::net::{TcpListener, TcpStream};

    use super::*;

    #[test]
    fn a_connection_is_its_users() {
        for place in ["127.0.0.1:0", "[::1]:0"] {
            // A machine may have no IPv6.
            let Ok(listener) = TcpListener::bind(place) else {
                continue;
            };
            let here = listener.local_addr().unwrap();
            let stream = TcpStream::connect(here).unwrap();
            let (_end, peer) = listener.accept().unwrap();
            assert_eq!(of(peer, here), Peer::User(fleetyard_runtime::user()));
            drop(stream);
            assert_eq!(of(peer, here), Peer::Gone);
        }
        let elsewhere = "192.0.2.1:80".parse().unwrap();
        assert_eq!(of(elsewhere, elsewhere), Peer::Unknown);
    }

    #[test]
    fn rows_are_read() {
        let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n\
            \x20  0: 0100007F:1F90 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 41 1 0 100 0 0 10 0\n\
            \x20  1: 0100007F:C350 0100007F:1F90 01 00000000:00000000 00:00000000 00000000  1001        0 42 1 0 20 4 30 10 -1\n\
            \x20  2: 0100007F:C351 0100007F:1F90 05 00000000:00000000 00:00000000 00000000     0        0 0 1 0 20 4 30 10 -1\n\
            \x20  3: 0000000000000000FFFF00000100007F:C352 0000000000000000FFFF00000100007F:1F90 01 00000000:00000000 00:00000000 00000000  1002        0 43 1 0\n";
        let here = "127.0.0.1:8080".parse().unwrap();
        let peer = |port: u16| listed(table, SocketAddr::from(([127, 0, 0, 1], port)), here);
        let expected = [
            Some(Peer::User(1001)),
            Some(Peer::Gone),
            Some(Peer::User(1002)),
            None,
        ];
        assert_eq!([50_000, 50_001, 50_002, 50_003].map(peer), expected);
    }
}
