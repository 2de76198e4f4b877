//! The manifest, `planner.toml`: read strictly, so that a mistake is found where
//! it was made and not in a run.

use std::path::PathBuf;

use fleetyard_core::InputError;

use super::document::{Document, Table, shown};

/// The largest manifest that is read, in bytes.
pub const MANIFEST_LIMIT: u64 = 1 << 20;

/// The version of the manifest's format.
const FORMAT: i64 = 1;

/// What a `planner.toml` says.
#[derive(Debug, Clone)]
pub struct Manifest {
    /// Identifier of the planner.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Version, unless the solver is asked for it.
    pub version: String,
    /// One paragraph, the paper cited.
    pub description: String,
    /// SPDX licence expression.
    pub license: String,
    /// Where the solver comes from.
    pub homepage: String,
    /// How the solver is started.
    pub program: Program,
}

/// How a solver is started.
#[derive(Debug, Clone)]
pub struct Program {
    /// A name to be looked for on `PATH`, or a path, which is relative to the
    /// manifest's folder.
    pub command: PathBuf,
}

impl Manifest {
    /// Reads a manifest; `source` is its name in errors.
    pub fn read(text: &str, source: &str) -> Result<Self, InputError> {
        if text.len() as u64 > MANIFEST_LIMIT {
            let reason = format!("a manifest has at most {MANIFEST_LIMIT} bytes");
            return Err(InputError::new(source, reason));
        }
        let document = Document::new(source, text);
        let root = document.parse()?;
        let root = Table::new(
            document,
            "",
            0,
            root.get_ref(),
            &[
                "manifest",
                "id",
                "name",
                "version",
                "description",
                "license",
                "homepage",
                "program",
            ],
        )?;
        let format = root.require("manifest")?;
        if format.integer(1, i64::MAX)? != FORMAT {
            return Err(format
                .error("this manifest is written for a newer host")
                .hint(format!(
                    "this host reads manifests with `manifest = {FORMAT}`"
                )));
        }
        let id = root.require("id")?;
        let text = |key| Ok(root.text(key)?.unwrap_or_default().to_owned());
        let program = root.require("program")?;
        Ok(Self {
            id: identifier(id.text()?).map_err(|reason| {
                id.error(reason)
                    .hint("it begins with a-z or 0-9 and goes on with a-z, 0-9, '.', '_' and '-'")
            })?,
            name: text("name")?,
            version: text("version")?,
            description: text("description")?,
            license: text("license")?,
            homepage: text("homepage")?,
            program: Program::read(&program.table("[program]", &["command"])?)?,
        })
    }
}

fn identifier(text: &str) -> Result<String, String> {
    let first = |letter: u8| letter.is_ascii_lowercase() || letter.is_ascii_digit();
    let fits = text
        .bytes()
        .enumerate()
        .all(|(at, letter)| first(letter) || at > 0 && matches!(letter, b'.' | b'_' | b'-'));
    if text.is_empty() || !fits || text.len() > 100 {
        return Err(format!("`{}` is no identifier", shown(text)));
    }
    Ok(text.to_owned())
}

impl Program {
    fn read(table: &Table<'_, '_>) -> Result<Self, InputError> {
        Ok(Self {
            command: table.require("command")?.nonempty()?.into(),
        })
    }
}
