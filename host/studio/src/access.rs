//! Access to the studio: for those who have a key of it, from a page that it served or from a script.
//!
//! A browser lets any page send requests to any address, also to this machine, and a name may lead
//! here although it did not when the page was loaded. So a request has to name this server as its
//! host, comes from no other page, and has a key in a header that no browser sends by itself: what it
//! does send by itself, cookies, goes to every port of a host. Files of the page have no secrets, and
//! are for everybody who may connect.
//!
//! The printed token, and the ticket of the browser that the command starts, are exchanged for keys:
//! one for each page that comes in. What no page can send a header with, a socket and a new window,
//! comes with a ticket of its own.

use std::collections::VecDeque;
use std::net::IpAddr;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::http::header::{AUTHORIZATION, HOST, ORIGIN};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Request, StatusCode};
use rustix::rand::{GetRandomFlags, getrandom};

use crate::answer::Refused;

/// The route by which a page comes in.
pub(crate) const ENTER: &str = "/api/enter";

/// Most keys, and most tickets: the oldest goes.
const MOST: usize = 256;

/// The time for which a ticket that a page asked for is good.
const TICKET: Duration = Duration::from_secs(30);

/// Headers of every answer: a page of the studio loads nothing from elsewhere, is shown in no other
/// page, and says to nobody where it was.
pub(crate) const HEADERS: [(HeaderName, HeaderValue); 6] = [
    (
        axum::http::header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        ),
    ),
    (
        axum::http::header::X_CONTENT_TYPE_OPTIONS,
        HeaderValue::from_static("nosniff"),
    ),
    (
        axum::http::header::REFERRER_POLICY,
        HeaderValue::from_static("no-referrer"),
    ),
    (
        HeaderName::from_static("cross-origin-resource-policy"),
        HeaderValue::from_static("same-origin"),
    ),
    (
        HeaderName::from_static("cross-origin-opener-policy"),
        HeaderValue::from_static("same-origin"),
    ),
    (
        axum::http::header::CACHE_CONTROL,
        HeaderValue::from_static("no-store"),
    ),
];

/// The secrets of a studio, and the names by which it may be called.
#[derive(Debug)]
pub(crate) struct Access {
    address: IpAddr,
    port: u16,
    token: String,
    given: Mutex<Given>,
}

/// Secrets that were given out.
#[derive(Debug)]
struct Given {
    /// For the browser that is started, once: its command line is for everybody to read.
    first: Option<String>,
    /// Of pages that came in.
    keys: VecDeque<String>,
    /// For a request each, and when they were given.
    tickets: VecDeque<(String, Instant)>,
}

/// A request that may be answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Entry {
    /// Of somebody who has shown no key, for a file of the page.
    Page,
    /// Of somebody with a key, for whatever it asks for.
    Allowed,
    /// Of a page that comes in: by this key, which is its own.
    Welcome(String),
}

impl Access {
    /// For a server at this address, with a new token.
    pub(crate) fn new(address: IpAddr, port: u16) -> std::io::Result<Self> {
        Ok(Self {
            address,
            port,
            token: secret()?,
            given: Mutex::new(Given {
                first: Some(secret()?),
                keys: VecDeque::new(),
                tickets: VecDeque::new(),
            }),
        })
    }

    fn given(&self) -> MutexGuard<'_, Given> {
        self.given.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The address for people and scripts. No browser sends what is after the `#`.
    pub(crate) fn printed(&self) -> String {
        format!("{}/#token={}", self.origin(), self.token)
    }

    /// The address for a browser that is started: it is worth something once.
    pub(crate) fn for_browser(&self) -> String {
        let given = self.given();
        let first = given.first.as_deref().unwrap_or_default();
        format!("{}/#token={first}", self.origin())
    }

    fn origin(&self) -> String {
        let host = match self.address {
            address if address.is_unspecified() => "127.0.0.1".to_owned(),
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) => format!("[{address}]"),
        };
        format!("http://{host}:{}", self.port)
    }

    /// A ticket for one request by `GET`.
    pub(crate) fn ticket(&self) -> std::io::Result<String> {
        let ticket = secret()?;
        keep(&mut self.given().tickets, (ticket.clone(), Instant::now()));
        Ok(ticket)
    }

    /// Lets a request in, or says why not. `is_of_the_page` is true of a path that leads to a file of the
    /// page.
    pub(crate) fn check<B>(
        &self,
        request: &Request<B>,
        is_of_the_page: bool,
    ) -> Result<Entry, Refused> {
        let headers = request.headers();
        let host = only(headers, &HOST).filter(|host| self.is_ours(host));
        let named = request.uri().authority();
        let host = host.filter(|host| named.is_none_or(|named| named.as_str() == *host));
        let Some(host) = host else {
            return Err(Refused::new(
                StatusCode::MISDIRECTED_REQUEST,
                "the request is not for this server",
            )
            .hint("open the address that the command printed"));
        };
        let ours = |origin: &str| origin.strip_prefix("http://") == Some(host);
        if headers.contains_key(ORIGIN) && !only(headers, &ORIGIN).is_some_and(ours) {
            return Err(Refused::new(
                StatusCode::FORBIDDEN,
                "the request does not come from this server's page",
            )
            .hint("a script sends no Origin, and the token in Authorization"));
        }
        let reads = *request.method() == Method::GET;
        let bearer = only(headers, &AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
        let ticket = request
            .uri()
            .query()
            .and_then(|query| query.strip_prefix("ticket="));
        let enters = request.uri().path() == ENTER && *request.method() == Method::POST;
        if bearer.is_some_and(|key| self.is_key(key) || enters && self.is_first(key)) {
            return if enters {
                self.admit()
            } else {
                Ok(Entry::Allowed)
            };
        }
        if reads && ticket.is_some_and(|ticket| self.takes(ticket)) {
            return Ok(Entry::Allowed);
        }
        if is_of_the_page && (reads || *request.method() == Method::HEAD) {
            return Ok(Entry::Page);
        }
        Err(
            Refused::new(StatusCode::UNAUTHORIZED, "the token is missing or wrong")
                .hint("open the address that the command printed"),
        )
    }

    fn is_key(&self, given: &str) -> bool {
        same(given, &self.token) || self.given().keys.iter().any(|key| same(given, key))
    }

    /// True of the started browser's ticket, which is worth nothing from then on.
    fn is_first(&self, given: &str) -> bool {
        let mut all = self.given();
        all.first.take_if(|first| same(given, first)).is_some()
    }

    /// True of a ticket that a page has asked for, which is worth nothing from then on.
    fn takes(&self, given: &str) -> bool {
        let mut all = self.given();
        all.tickets.retain(|(_, since)| since.elapsed() < TICKET);
        let at = all
            .tickets
            .iter()
            .position(|(ticket, _)| same(given, ticket));
        at.is_some_and(|at| all.tickets.remove(at).is_some())
    }

    fn admit(&self) -> Result<Entry, Refused> {
        let key = secret().map_err(|error| Refused::machine("there are no random bits", error))?;
        keep(&mut self.given().keys, key.clone());
        Ok(Entry::Welcome(key))
    }

    /// True of the names of this server. A number that stands for the address is one; a name that
    /// leads here is none, for whoever has it may have it lead elsewhere.
    fn is_ours(&self, host: &str) -> bool {
        let Some((name, port)) = host.rsplit_once(':') else {
            return false;
        };
        if port != self.port.to_string() {
            return false;
        }
        let bare = name
            .strip_prefix('[')
            .and_then(|name| name.strip_suffix(']'));
        let number = bare.unwrap_or(name).parse::<IpAddr>().ok();
        match number {
            Some(number) if self.address.is_unspecified() => number.is_ipv4() || bare.is_some(),
            Some(number) => number == self.address,
            None => {
                name == "localhost" && (self.address.is_loopback() || self.address.is_unspecified())
            }
        }
    }
}

/// Adds one, for which the oldest goes where there are too many.
fn keep<T>(all: &mut VecDeque<T>, one: T) {
    all.push_back(one);
    if all.len() > MOST {
        all.pop_front();
    }
}

/// 128 random bits as text.
fn secret() -> std::io::Result<String> {
    let mut bytes = [0; 16];
    let mut filled = 0;
    while filled < bytes.len() {
        filled += getrandom(&mut bytes[filled..], GetRandomFlags::empty())?;
    }
    Ok(format!("{:032x}", u128::from_le_bytes(bytes)))
}

/// The value of a header that is there once.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    value.to_str().ok().filter(|_| values.next().is_none())
}

/// True of equal texts, in a time that says nothing of where they differ.
fn same(given: &str, secret: &str) -> bool {
    let (given, secret) = (given.as_bytes(), secret.as_bytes());
    let differences = given
        .iter()
        .zip(secret)
        .fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == secret.len() && differences == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A request, its headers, and what comes of it.
    type Case<'a> = (&'a str, &'a [(&'a str, &'a str)], Result<Entry, u16>);

    fn access(address: &str) -> Access {
        Access::new(address.parse().unwrap(), 8123).unwrap()
    }

    fn ask(access: &Access, line: &str, headers: &[(&str, &str)]) -> Result<Entry, u16> {
        let (method, uri) = line.split_once(' ').unwrap();
        let mut request = Request::builder().method(method).uri(uri);
        for (name, value) in headers {
            let value = value.replace("TOKEN", &access.token);
            request = request.header(*name, value);
        }
        let is_of_the_page = !uri.contains("/api/");
        let asked = access.check(&request.body(()).unwrap(), is_of_the_page);
        asked.map_err(|refused| refused.status().as_u16())
    }

    #[test]
    fn a_request_names_this_server_has_the_token_and_comes_from_its_page() {
        let access = access("127.0.0.1");
        let host = ("host", "127.0.0.1:8123");
        let origin = ("origin", "http://127.0.0.1:8123");
        let bearer = ("authorization", "Bearer TOKEN");
        let allowed = Ok(Entry::Allowed);
        let page = Ok(Entry::Page);
        let cases: &[Case<'_>] = &[
            ("GET /", &[host], page.clone()),
            ("HEAD /main.js", &[host], page.clone()),
            ("POST /", &[host], Err(401)),
            ("GET /api/studio", &[host, bearer], allowed.clone()),
            (
                "GET /api/studio",
                &[("host", "localhost:8123"), bearer],
                allowed.clone(),
            ),
            ("POST /api/edit", &[host, bearer], allowed.clone()),
            ("POST /api/edit", &[host, bearer, origin], allowed.clone()),
            ("GET /api/studio", &[host], Err(401)),
            // A browser sends cookies to every port of a host.
            (
                "GET /api/studio",
                &[host, ("cookie", "fleetyard-8123=TOKEN")],
                Err(401),
            ),
            (
                "GET /api/studio",
                &[host, ("authorization", "Bearer no")],
                Err(401),
            ),
            (
                "GET /api/studio",
                &[host, ("authorization", "Bearer TOKEN0")],
                Err(401),
            ),
            ("GET /api/studio", &[host, bearer, bearer], Err(401)),
            ("GET /api/studio?token=TOKEN", &[host], Err(401)),
            ("GET /api/studio?ticket=", &[host], Err(401)),
            ("POST /api/enter", &[host], Err(401)),
            ("GET /", &[], Err(421)),
            ("GET /", &[("host", "127.0.0.1")], Err(421)),
            ("GET /", &[("host", "127.0.0.1:80")], Err(421)),
            ("GET /", &[("host", "rebound.example:8123")], Err(421)),
            ("GET /", &[("host", "10.0.0.1:8123"), bearer], Err(421)),
            ("GET /", &[host, host], Err(421)),
            ("GET http://rebound.example/", &[host], Err(421)),
            (
                "POST /api/edit",
                &[host, bearer, ("origin", "null")],
                Err(403),
            ),
            (
                "POST /api/edit",
                &[host, bearer, ("origin", "http://localhost:8123")],
                Err(403),
            ),
            (
                "GET /api/studio",
                &[host, bearer, ("origin", "http://rebound.example")],
                Err(403),
            ),
            (
                "GET /",
                &[host, ("origin", "https://127.0.0.1:8123")],
                Err(403),
            ),
        ];
        for (line, headers, expected) in cases {
            assert_eq!(&ask(&access, line, headers), expected, "{line} {headers:?}");
        }
    }

    /// The key of a page that comes in with a secret.
    fn enter(access: &Access, secret: &str) -> Result<String, u16> {
        let bearer = format!("Bearer {secret}");
        let headers = &[("host", "127.0.0.1:8123"), ("authorization", &*bearer)];
        match ask(access, "POST /api/enter", headers)? {
            Entry::Welcome(key) => Ok(key),
            other => panic!("{other:?}"),
        }
    }

    fn secret_of(address: &str) -> &str {
        address
            .strip_prefix("http://127.0.0.1:8123/#token=")
            .unwrap()
    }

    #[test]
    fn pages_come_in_by_the_token_and_the_started_browser_once() {
        let access = access("127.0.0.1");
        assert_eq!(access.token.len(), 32);
        let with = |key: &str| {
            let bearer = format!("Bearer {key}");
            let headers = &[("host", "127.0.0.1:8123"), ("authorization", &*bearer)];
            ask(&access, "POST /api/edit", headers)
        };
        let token = access.printed();
        let (one, other) = (
            enter(&access, secret_of(&token)),
            enter(&access, secret_of(&token)),
        );
        let (one, other) = (one.unwrap(), other.unwrap());
        assert!(one != other && one != access.token);
        assert_eq!(
            (with(&one), with(&other)),
            (Ok(Entry::Allowed), Ok(Entry::Allowed))
        );
        let first = access.for_browser();
        // It opens the door and nothing else.
        assert_eq!(with(secret_of(&first)), Err(401));
        let third = enter(&access, secret_of(&first)).unwrap();
        assert_eq!(with(&third), Ok(Entry::Allowed));
        assert_eq!(enter(&access, secret_of(&first)), Err(401));
        assert_eq!(enter(&access, ""), Err(401));
        for _ in 0..MOST {
            enter(&access, &access.token).unwrap();
        }
        assert_eq!(with(&one), Err(401));
    }

    #[test]
    fn a_ticket_is_good_for_one_request_that_reads() {
        let access = access("127.0.0.1");
        let host = ("host", "127.0.0.1:8123");
        let ticket = access.ticket().unwrap();
        let ask = |line: &str| ask(&access, &line.replace("TICKET", &ticket), &[host]);
        assert_eq!(ask("POST /api/edit?ticket=TICKET"), Err(401));
        assert_eq!(ask("GET /api/feed?ticket=TICKET"), Ok(Entry::Allowed));
        assert_eq!(ask("GET /api/feed?ticket=TICKET"), Err(401));
    }

    #[test]
    fn a_studio_for_others_is_called_by_numbers() {
        let access = access("0.0.0.0");
        let with = |host| {
            let headers = &[("host", host), ("authorization", "Bearer TOKEN")];
            ask(&access, "GET /api/studio", headers)
        };
        assert_eq!(with("192.168.7.9:8123"), Ok(Entry::Allowed));
        assert_eq!(with("localhost:8123"), Ok(Entry::Allowed));
        assert_eq!(with("studio.example:8123"), Err(421));
    }
}
