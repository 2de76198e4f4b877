//! The files of the page, which are a part of this program.

use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};

use crate::answer::Refused;

/// Declares files of `web/` by their names.
macro_rules! files {
    ($($name:literal),* $(,)?) => {
        const FILES: &[(&str, &[u8])] = &[
            $(($name, include_bytes!(concat!("../web/", $name))),)*
        ];
    };
}

files![
    "api.js",
    "charts.js",
    "commands.js",
    "dom.js",
    "door.js",
    "drawing.js",
    "edits.js",
    "forms.js",
    "geometry.js",
    "icon.svg",
    "index.html",
    "jobs.js",
    "layers.js",
    "link.js",
    "live.js",
    "main.js",
    "minimap.js",
    "panel-plan.js",
    "panel-robots.js",
    "panel-watch.js",
    "panel-world.js",
    "places.js",
    "planners.js",
    "reservations.js",
    "save.js",
    "selection.js",
    "store.js",
    "studio.css",
    "suite.js",
    "survey.js",
    "tools.js",
    "waits.js",
    "watch.js",
];

/// True of a path that leads to a file of the page or of the viewer.
pub(crate) fn is_file(path: &str) -> bool {
    match path.strip_prefix('/') {
        Some("") => true,
        Some(name) => match name.strip_prefix("viewer/") {
            Some(name) => fleetyard_view::web()
                .iter()
                .any(|(known, ..)| *known == name),
            None => FILES.iter().any(|(known, _)| *known == name),
        },
        None => false,
    }
}

/// A file of the page; the page itself without a name.
pub(crate) fn file(name: &str) -> Response {
    let name = if name.is_empty() { "index.html" } else { name };
    let found = FILES.iter().find(|(known, _)| *known == name);
    match found {
        Some((name, bytes)) => ([(CONTENT_TYPE, media_type(name))], *bytes).into_response(),
        None => Refused::unknown("file").into_response(),
    }
}

/// A file of the viewer, which replay pages have, too.
pub(crate) fn viewer(name: &str) -> Response {
    let found = fleetyard_view::web()
        .iter()
        .find(|(known, ..)| *known == name);
    match found {
        Some((_, bytes, media_type)) => ([(CONTENT_TYPE, *media_type)], *bytes).into_response(),
        None => Refused::unknown("file").into_response(),
    }
}

/// The media type of a name.
pub(crate) fn media_type(name: &str) -> &'static str {
    match name.rsplit_once('.').map_or("", |(_, end)| end) {
        "html" => "text/html; charset=utf-8",
        "css" => "text/css; charset=utf-8",
        "js" => "text/javascript; charset=utf-8",
        "json" => "application/json",
        "svg" => "image/svg+xml",
        "png" => "image/png",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::fs;
    use std::path::Path;

    use super::FILES;

    #[test]
    fn all_files_of_the_page_are_served() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("web");
        let there: BTreeSet<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        let served: BTreeSet<String> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
        assert_eq!(served, there);
    }
}
