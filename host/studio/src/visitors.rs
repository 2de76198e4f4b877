//! Connections, of which there are only so many: whoever has not shown a right to be here has a short
//! time to do so, and is the first to go when more come. The studio's own pages stay. Other users of the
//! machine are no visitors at all.

use std::future::Future;
use std::io;
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock, Weak};
use std::task::{Context, Poll};
use std::time::Duration;

use axum::extract::connect_info::Connected;
use axum::serve::{IncomingStream, Listener};
use futures_util::task::AtomicWaker;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Sleep, sleep};

use crate::peer::{self, Peer};

/// Most connections: half of the files that a process may have open by default.
const MOST: usize = 512;

/// The time that a connection has until a request of it is let in.
const AT_THE_DOOR: Duration = Duration::from_secs(10);

/// Whoever is at the other end of a connection.
#[derive(Debug)]
pub(crate) struct Visitor {
    /// The ends of the connection: the other one, and ours.
    ends: (SocketAddr, SocketAddr),
    is_known: OnceLock<bool>,
    is_in: AtomicBool,
    is_sent_away: AtomicBool,
    waiting: AtomicWaker,
}

impl Visitor {
    fn new(ends: (SocketAddr, SocketAddr)) -> Self {
        Self {
            ends,
            is_known: OnceLock::new(),
            is_in: AtomicBool::new(false),
            is_sent_away: AtomicBool::new(false),
            waiting: AtomicWaker::new(),
        }
    }

    /// False for another user of this machine.
    pub(crate) fn is_known(&self) -> bool {
        let (peer, here) = self.ends;
        *self.is_known.get_or_init(|| match peer::of(peer, here) {
            Peer::User(user) => user == 0 || user == fleetyard_runtime::user(),
            Peer::Gone => false,
            Peer::Unknown => true,
        })
    }

    /// Stays for as long as it likes.
    pub(crate) fn let_in(&self) {
        self.is_in.store(true, Ordering::Relaxed);
    }

    fn send_away(&self) {
        self.is_sent_away.store(true, Ordering::Relaxed);
        self.waiting.wake();
    }
}

/// A listener that counts.
#[derive(Debug)]
pub(crate) struct Reception {
    listener: TcpListener,
    /// In the order in which they came.
    visitors: Vec<Weak<Visitor>>,
}

impl Reception {
    pub(crate) fn new(listener: TcpListener) -> Self {
        Self {
            listener,
            visitors: Vec::new(),
        }
    }

    /// One more, if there is room or somebody who can go.
    fn receive(&mut self, ends: (SocketAddr, SocketAddr)) -> Option<Arc<Visitor>> {
        self.visitors.retain(|visitor| visitor.strong_count() > 0);
        if self.visitors.len() >= MOST {
            let visitors = self.visitors.iter().map(Weak::upgrade);
            let (at, stranger) = visitors.enumerate().find_map(|(at, visitor)| {
                let stranger = visitor.filter(|visitor| !visitor.is_in.load(Ordering::Relaxed))?;
                Some((at, stranger))
            })?;
            stranger.send_away();
            self.visitors.remove(at);
        }
        let visitor = Arc::new(Visitor::new(ends));
        self.visitors.push(Arc::downgrade(&visitor));
        Some(visitor)
    }
}

impl Listener for Reception {
    type Io = Connection;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Connection, SocketAddr) {
        loop {
            let (stream, address) = Listener::accept(&mut self.listener).await;
            let here = stream.local_addr().unwrap_or(address);
            if let Some(visitor) = self.receive((address, here)) {
                let patience = Box::pin(sleep(AT_THE_DOOR));
                let connection = Connection {
                    stream,
                    visitor,
                    patience,
                };
                return (connection, address);
            }
        }
    }

    fn local_addr(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }
}

/// A visitor, as requests know their own.
#[derive(Debug, Clone)]
pub(crate) struct Visit(pub(crate) Arc<Visitor>);

impl Connected<IncomingStream<'_, Reception>> for Visit {
    fn connect_info(stream: IncomingStream<'_, Reception>) -> Self {
        Self(Arc::clone(&stream.io().visitor))
    }
}

/// A connection that ends when its visitor is sent away.
#[derive(Debug)]
pub(crate) struct Connection {
    stream: TcpStream,
    visitor: Arc<Visitor>,
    patience: Pin<Box<Sleep>>,
}

impl Connection {
    /// Fails for a stranger who was sent away or has had the time there is; else wakes when it may be so.
    fn stays(&mut self, context: &mut Context<'_>) -> io::Result<()> {
        if self.visitor.is_in.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.visitor.waiting.register(context.waker());
        let is_over = self.visitor.is_sent_away.load(Ordering::Relaxed)
            || self.patience.as_mut().poll(context).is_ready();
        if is_over {
            return Err(io::ErrorKind::TimedOut.into());
        }
        Ok(())
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let this = self.get_mut();
        this.stays(context)?;
        Pin::new(&mut this.stream).poll_read(context, buffer)
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.stays(context)?;
        Pin::new(&mut this.stream).poll_write(context, bytes)
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let this = self.get_mut();
        this.stays(context)?;
        Pin::new(&mut this.stream).poll_write_vectored(context, parts)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_flush(context)
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.get_mut().stream).poll_shutdown(context)
    }
}
