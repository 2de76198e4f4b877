//! A studio that runs, and requests to it over plain sockets.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write};
use std::iter;
use std::net::TcpStream;
use std::process::ExitStatus;

use serde_json::Value;
use tungstenite::{Message, WebSocket, client};

use crate::command::{Ended, Started, Yard, is_ignored, until, words};
use crate::devtools::read;

/// A studio.
pub struct Studio {
    started: Option<Started>,
    /// Its port.
    pub port: u16,
    /// The secret that lets requests in.
    pub token: String,
}

/// An answer.
#[derive(Debug)]
pub struct Reply {
    /// The status code.
    pub status: u16,
    /// Names, in small letters, and values.
    pub headers: Vec<(String, String)>,
    /// The content.
    pub body: Vec<u8>,
}

impl Reply {
    /// The value of a header, or nothing.
    pub fn header(&self, name: &str) -> &str {
        let found = self.headers.iter().find(|(known, _)| known == name);
        found.map_or("", |(_, value)| value)
    }

    /// The content as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&self.body)))
    }

    /// Fails unless the status is right.
    #[track_caller]
    #[expect(clippy::return_self_not_must_use, reason = "some callers ask no more")]
    pub fn expect(self, status: u16) -> Self {
        let body = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status, status, "{body}");
        self
    }
}

impl Studio {
    /// Starts a studio without a browser, with more arguments.
    pub fn start(yard: &Yard, more: &str) -> Self {
        Self::with_arguments(yard, &words(&format!("--no-open {more}")))
    }

    /// Starts a studio with these arguments alone: with a browser, unless they say otherwise.
    pub fn with_arguments<S: AsRef<OsStr>>(yard: &Yard, arguments: &[S]) -> Self {
        let arguments = arguments.iter().map(AsRef::as_ref);
        let arguments: Vec<_> = iter::once("studio".as_ref()).chain(arguments).collect();
        let mut started = yard.start(&arguments);
        let stdout = started.child.stdout.take().unwrap();
        let mut stdout = BufReader::new(stdout);
        let mut address = String::new();
        stdout.read_line(&mut address).unwrap();
        started.child.stdout = Some(stdout.into_inner());
        let parts = address.trim().strip_prefix("http://127.0.0.1:");
        let parts = parts.and_then(|rest| rest.split_once("/#token="));
        let Some((port, token)) = parts else {
            panic!("no address: {address:?}\n{}", started.wait());
        };
        Self {
            port: port.parse().unwrap(),
            token: token.to_owned(),
            started: Some(started),
        }
    }

    /// The address with the secret.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/#token={}", self.port, self.token)
    }

    /// The processes of the studio and of its jobs.
    pub fn processes(&self) -> Vec<crate::Process> {
        self.started.as_ref().unwrap().processes()
    }

    /// The process of the studio.
    pub fn process(&self) -> u32 {
        self.started.as_ref().unwrap().child.id()
    }

    /// Sends a request as it is, and returns the answer.
    pub fn send(&self, head: &str, body: &[u8]) -> Reply {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        // One that is refused for its size is not read to its end.
        let _ = stream.write_all(body);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n");
        let end = end.unwrap_or_else(|| panic!("no answer to {head}"));
        let head = String::from_utf8_lossy(&answer[..end]);
        let mut lines = head.lines();
        let status = lines.next().unwrap().split(' ').nth(1).unwrap();
        Reply {
            status: status.parse().unwrap(),
            headers: lines
                .filter_map(|line| line.split_once(": "))
                .map(|(name, value)| (name.to_lowercase(), value.to_owned()))
                .collect(),
            body: answer[end + 4..].to_vec(),
        }
    }

    /// A request with headers of its own beside Host and the length.
    pub fn with(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Reply {
        let mut head = format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\nContent-Length: {}\r\n",
            self.port,
            body.len()
        );
        for (name, value) in headers {
            // Writing to a string cannot fail.
            let _ = write!(head, "{name}: {value}\r\n");
        }
        self.send(&format!("{head}\r\n"), body)
    }

    /// A request of a script.
    pub fn ask(&self, method: &str, path: &str, body: &[u8]) -> Reply {
        let bearer = format!("Bearer {}", self.token);
        self.with(method, path, &[("Authorization", &bearer)], body)
    }

    /// Gets something.
    pub fn get(&self, path: &str) -> Reply {
        self.ask("GET", path, b"")
    }

    /// Posts JSON.
    pub fn post(&self, path: &str, value: &Value) -> Reply {
        self.ask("POST", path, value.to_string().as_bytes())
    }

    /// Edits the document as it is.
    #[track_caller]
    pub fn edit(&self, op: &Value) -> Value {
        let version = self.get("/api/document").json()["version"].clone();
        let asked = serde_json::json!({"base_version": version, "op": op});
        self.post("/api/edit", &asked).expect(200).json()
    }

    /// Waits until a job is over, and returns it.
    #[track_caller]
    pub fn wait_for(&self, job: &Value) -> Value {
        let path = format!("/api/jobs/{}", job["id"]);
        let mut now = Value::Null;
        let over = until(|| {
            now = self.get(&path).expect(200).json();
            let state = now["state"].as_str().unwrap();
            !["queued", "running", "stopping"].contains(&state)
        });
        assert!(over, "the job does not end: {now}");
        now
    }

    /// The feed of a script.
    pub fn feed(&self) -> WebSocket<TcpStream> {
        self.feed_at("/api/feed", Some(&self.token))
    }

    /// The feed at a path, by a key or without one.
    pub fn feed_at(&self, path: &str, key: Option<&str>) -> WebSocket<TcpStream> {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let mut request = tungstenite::http::Request::builder()
            .uri(format!("ws://127.0.0.1:{}{path}", self.port))
            .header("Host", format!("127.0.0.1:{}", self.port))
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header(
                "Sec-WebSocket-Key",
                tungstenite::handshake::client::generate_key(),
            );
        if let Some(key) = key {
            request = request.header("Authorization", format!("Bearer {key}"));
        }
        let request = request.body(()).unwrap();
        client(request, stream).unwrap().0
    }

    /// Ends the studio by a signal, or by TERM where that one is ignored, and returns what it said.
    pub fn end(mut self, signal: &str) -> Ended {
        let signal = if is_ignored(signal) { "TERM" } else { signal };
        let started = self.started.take().unwrap();
        let me = started.child.id();
        for process in started.processes() {
            if process.id == me {
                process.signal(signal);
            }
        }
        started.wait()
    }

    /// Kills the studio and waits for that alone.
    pub fn kill(&mut self) -> ExitStatus {
        let child = &mut self.started.as_mut().unwrap().child;
        child.kill().unwrap();
        child.wait().unwrap()
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        if let Some(mut started) = self.started.take() {
            // A test that failed leaves nothing.
            started.stop();
            let _ = started.child.wait();
        }
    }
}

/// The next message of a feed as JSON; frames of clips are passed over.
pub fn next_text(feed: &mut WebSocket<TcpStream>) -> Value {
    loop {
        match read(feed).unwrap() {
            Message::Text(text) => return serde_json::from_str(&text).unwrap(),
            Message::Close(_) => return Value::Null,
            _ => {}
        }
    }
}
