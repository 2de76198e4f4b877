//! The shell of pages that are one file: the head with a policy that lets nothing be
//! loaded, the colours of both themes, and the script, which is the only one that the policy lets run. Style
//! and body are the page's own.

use serde::Serialize;
use sha2::{Digest as _, Sha256};

use crate::element::escape;
use crate::track::base64;

const SHELL: &str = include_str!("shell.html");
const STYLE: &str = include_str!("../web/shell.css");

/// A page without its content.
#[derive(Debug, Clone, Copy)]
pub struct Shell<'a> {
    /// The title, as text.
    pub title: &'a str,
    /// The page's own style, after the one that all pages have.
    pub style: &'a str,
    /// The pieces of the script.
    pub script: &'a [&'a str],
    /// The content, in which `{{NAME}}` stands for a part of that name, or the title.
    pub body: &'a str,
}

impl Shell<'_> {
    /// The page. Parts are HTML, with their names.
    pub fn page(&self, parts: &[(&str, &str)]) -> String {
        let size: usize = parts.iter().map(|(_, part)| part.len()).sum();
        let script = self.script.concat();
        let policy = policy(self.script);
        let mut page = String::with_capacity(size + script.len() + self.body.len() + 20_000);
        let title = escape(self.title);
        fill(&mut page, SHELL, &mut |page, name| match name {
            "title" => page.push_str(&title),
            "style" => page.extend([STYLE, self.style]),
            "script" => page.push_str(&script),
            "policy" => page.push_str(&policy),
            "body" => fill(page, self.body, &mut |page, name| {
                let part = parts.iter().find(|(known, _)| *known == name);
                page.push_str(match (part, name) {
                    (Some((_, part)), _) => part,
                    (None, "title") => &title,
                    (None, other) => unreachable!("the page has no {other}"),
                });
            }),
            other => unreachable!("the shell has no {other}"),
        });
        page
    }
}

/// The policy of a page with this script, in pieces: nothing is loaded, and no other script runs.
pub fn policy(script: &[&str]) -> String {
    let digest = base64(&Sha256::digest(script.concat()));
    format!(
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; base-uri 'none'; \
         form-action 'none'"
    )
}

/// Appends a template, with `part` in place of every `{{NAME}}`. What is put there is not
/// looked at again.
fn fill(page: &mut String, template: &str, part: &mut dyn FnMut(&mut String, &str)) {
    let mut rest = template;
    while let Some((before, (name, after))) = rest
        .split_once("{{")
        .and_then(|(before, rest)| Some((before, rest.split_once("}}")?)))
    {
        page.push_str(before);
        part(page, name);
        rest = after;
    }
    page.push_str(rest);
}

/// Data for the script of a page, as JSON in which no `<` ends the element that holds it.
pub fn embedded(data: &impl Serialize) -> serde_json::Result<String> {
    Ok(serde_json::to_string(data)?.replace('<', "\\u003c"))
}
