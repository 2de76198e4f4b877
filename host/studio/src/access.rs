//! Access to the studio: for those who have its token, from a page that it served or from a script.
//!
//! A browser lets any page send requests to any address, also to this machine, and a name may lead
//! here although it did not when the page was loaded. So a request has to name this server as its
//! host, has to have the token, which no other page can read or send along, and where it changes
//! anything has to come from our own page. Scripts send the token themselves, which pages cannot.

use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};

use axum::http::header::{AUTHORIZATION, COOKIE, HOST, ORIGIN, UPGRADE};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Request, StatusCode};
use rustix::rand::{GetRandomFlags, getrandom};

use crate::answer::Refused;

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

/// The secret of a studio, and the names by which it may be called.
#[derive(Debug)]
pub(crate) struct Access {
    address: IpAddr,
    port: u16,
    token: String,
    /// Stands for the token once: the command line of a browser is for everybody to read.
    ticket: Mutex<Option<String>>,
}

/// A request that may be answered.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Entry {
    /// By whatever it asks for.
    Allowed,
    /// By this cookie, and the address without the secret.
    Welcome(String),
}

impl Access {
    /// For a server at this address, with a new token.
    pub(crate) fn new(address: IpAddr, port: u16) -> std::io::Result<Self> {
        Ok(Self {
            address,
            port,
            token: secret()?,
            ticket: Mutex::new(Some(secret()?)),
        })
    }

    /// The address for people and scripts.
    pub(crate) fn printed(&self) -> String {
        format!("{}/?token={}", self.origin(), self.token)
    }

    /// The address for a browser that is started: it is worth something once.
    pub(crate) fn for_browser(&self) -> String {
        let ticket = self.ticket.lock().unwrap_or_else(PoisonError::into_inner);
        format!(
            "{}/?ticket={}",
            self.origin(),
            ticket.as_deref().unwrap_or_default()
        )
    }

    fn origin(&self) -> String {
        let host = match self.address {
            address if address.is_unspecified() => "127.0.0.1".to_owned(),
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) => format!("[{address}]"),
        };
        format!("http://{host}:{}", self.port)
    }

    /// Lets a request in, or says why not.
    pub(crate) fn check<B>(&self, request: &Request<B>) -> Result<Entry, Refused> {
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
        let elsewhere = || {
            Refused::new(
                StatusCode::FORBIDDEN,
                "the request does not come from this server's page",
            )
            .hint("a script sends no Origin, and the token in Authorization")
        };
        let has_origin = headers.contains_key(ORIGIN);
        if has_origin && !only(headers, &ORIGIN).is_some_and(ours) {
            return Err(elsewhere());
        }
        if let Some(cookie) = self.welcome(request) {
            return Ok(Entry::Welcome(cookie));
        }
        let bearer = only(headers, &AUTHORIZATION).and_then(|value| value.strip_prefix("Bearer "));
        if bearer.is_some_and(|token| same(token, &self.token)) {
            return Ok(Entry::Allowed);
        }
        if !cookies(headers, &self.cookie_name()).any(|token| same(token, &self.token)) {
            return Err(
                Refused::new(StatusCode::UNAUTHORIZED, "the token is missing or wrong")
                    .hint("open the address that the command printed"),
            );
        }
        let only_reads = matches!(*request.method(), Method::GET | Method::HEAD)
            && !headers.contains_key(UPGRADE);
        if !only_reads && !has_origin {
            return Err(elsewhere());
        }
        Ok(Entry::Allowed)
    }

    /// The cookie for somebody who comes with the token or with the ticket.
    fn welcome<B>(&self, request: &Request<B>) -> Option<String> {
        let uri = request.uri();
        if uri.path() != "/" || *request.method() != Method::GET {
            return None;
        }
        let (name, given) = uri.query()?.split_once('=')?;
        let is_right = match name {
            "token" => same(given, &self.token),
            "ticket" => {
                let mut ticket = self.ticket.lock().unwrap_or_else(PoisonError::into_inner);
                let right = ticket.as_deref().is_some_and(|ticket| same(given, ticket));
                if right {
                    *ticket = None;
                }
                right
            }
            _ => false,
        };
        is_right.then(|| {
            format!(
                "{}={}; Path=/; HttpOnly; SameSite=Strict",
                self.cookie_name(),
                self.token
            )
        })
    }

    fn cookie_name(&self) -> String {
        format!("fleetyard-{}", self.port)
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

/// The values of cookies of a name.
fn cookies<'a>(headers: &'a HeaderMap, name: &str) -> impl Iterator<Item = &'a str> {
    let values = headers.get_all(COOKIE).iter();
    let pairs = values.filter_map(|value| value.to_str().ok());
    let pairs = pairs.flat_map(|value| value.split(';'));
    pairs.filter_map(move |pair| {
        let (key, value) = pair.trim().split_once('=')?;
        (key == name).then_some(value)
    })
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
        let asked = access.check(&request.body(()).unwrap());
        asked.map_err(|refused| refused.status().as_u16())
    }

    #[test]
    fn a_request_names_this_server_has_the_token_and_comes_from_its_page() {
        let access = access("127.0.0.1");
        let host = ("host", "127.0.0.1:8123");
        let cookie = ("cookie", "a=b; fleetyard-8123=TOKEN");
        let origin = ("origin", "http://127.0.0.1:8123");
        let bearer = ("authorization", "Bearer TOKEN");
        let allowed = Ok(Entry::Allowed);
        let cases: &[Case<'_>] = &[
            ("GET /", &[host, cookie], allowed.clone()),
            ("GET /", &[host, bearer], allowed.clone()),
            (
                "GET /",
                &[("host", "localhost:8123"), cookie],
                allowed.clone(),
            ),
            ("POST /", &[host, cookie, origin], allowed.clone()),
            ("POST /", &[host, bearer], allowed.clone()),
            ("GET /", &[host], Err(401)),
            (
                "GET /",
                &[host, ("cookie", "fleetyard-8124=TOKEN")],
                Err(401),
            ),
            (
                "GET /",
                &[host, ("cookie", "fleetyard-8123=TOKEN0")],
                Err(401),
            ),
            ("GET /", &[host, ("authorization", "Bearer no")], Err(401)),
            ("GET /?token=no", &[host], Err(401)),
            ("GET /?ticket=", &[host], Err(401)),
            ("GET /", &[cookie], Err(421)),
            ("GET /", &[("host", "127.0.0.1"), cookie], Err(421)),
            ("GET /", &[("host", "127.0.0.1:80"), cookie], Err(421)),
            (
                "GET /",
                &[("host", "rebound.example:8123"), cookie],
                Err(421),
            ),
            ("GET /", &[("host", "10.0.0.1:8123"), cookie], Err(421)),
            ("GET /", &[host, host, cookie], Err(421)),
            ("GET http://rebound.example/", &[host, cookie], Err(421)),
            ("POST /", &[host, cookie], Err(403)),
            ("DELETE /", &[host, cookie], Err(403)),
            ("GET /", &[host, cookie, ("upgrade", "websocket")], Err(403)),
            (
                "GET /",
                &[host, cookie, origin, ("upgrade", "websocket")],
                allowed.clone(),
            ),
            ("POST /", &[host, cookie, ("origin", "null")], Err(403)),
            (
                "POST /",
                &[host, cookie, ("origin", "http://localhost:8123")],
                Err(403),
            ),
            (
                "POST /",
                &[host, bearer, ("origin", "http://rebound.example")],
                Err(403),
            ),
            (
                "GET /",
                &[host, cookie, ("origin", "https://127.0.0.1:8123")],
                Err(403),
            ),
        ];
        for (line, headers, expected) in cases {
            assert_eq!(&ask(&access, line, headers), expected, "{line} {headers:?}");
        }
    }

    #[test]
    fn the_token_is_a_welcome_and_the_ticket_is_one_once() {
        let access = access("127.0.0.1");
        let host = &[("host", "127.0.0.1:8123")];
        let cookie = format!(
            "fleetyard-8123={}; Path=/; HttpOnly; SameSite=Strict",
            access.token
        );
        assert_eq!(access.token.len(), 32);
        let path = |address: String| {
            let path = address.strip_prefix("http://127.0.0.1:8123").unwrap();
            format!("GET {path}")
        };
        let printed = path(access.printed());
        for _ in 0..2 {
            let welcome = Ok(Entry::Welcome(cookie.clone()));
            assert_eq!(ask(&access, &printed, host), welcome);
        }
        let once = path(access.for_browser());
        assert_eq!(ask(&access, &once, host), Ok(Entry::Welcome(cookie)));
        assert_eq!(ask(&access, &once, host), Err(401));
        // Only at the door.
        let elsewhere = printed.replace("/?", "/api/document?");
        assert_eq!(ask(&access, &elsewhere, host), Err(401));
    }

    #[test]
    fn a_studio_for_others_is_called_by_numbers() {
        let access = access("0.0.0.0");
        let with = |host| {
            ask(
                &access,
                "GET /",
                &[("host", host), ("cookie", "fleetyard-8123=TOKEN")],
            )
        };
        assert_eq!(with("192.168.7.9:8123"), Ok(Entry::Allowed));
        assert_eq!(with("localhost:8123"), Ok(Entry::Allowed));
        assert_eq!(with("studio.example:8123"), Err(421));
    }
}
