//! Plugins that can do what another one was refused for.

use std::fmt;

use fleetyard_abi::{Descriptor, Kind};

use crate::discover::{Discovered, first_with};
use crate::{Discovery, Runtime};

/// Most plugins that a hint names.
const NAMED: usize = 12;

/// The name of several plugins of a kind.
pub fn plural(kind: Kind) -> &'static str {
    match kind {
        Kind::Planner => "planners",
        Kind::FailPolicy => "fail policies",
        Kind::InstanceGenerator => "instance generators",
        Kind::InvocationPolicy => "invocation policies",
    }
}

/// The plugins that do what another one was refused for. As text it is a hint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Able {
    kind: Kind,
    ids: Vec<String>,
}

impl Able {
    /// Their identifiers in a line, in the order of the search for plugins; absent where there are none.
    pub fn named(&self) -> Option<String> {
        let ids = &self.ids;
        let named = ids[..ids.len().min(NAMED)].join(", ");
        match ids.len().saturating_sub(NAMED) {
            0 => (!named.is_empty()).then_some(named),
            more => Some(format!("{named} and {more} more")),
        }
    }
}

impl fmt::Display for Able {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.named() {
            Some(named) => write!(f, "{} that do: {named}", plural(self.kind)),
            None => write!(
                f,
                "no installed {} does",
                self.kind.as_str().replace('-', " ")
            ),
        }
    }
}

impl Runtime {
    /// The plugins of a kind whose descriptors fit, of all that can be found. The folders are searched
    /// when somebody is first refused, and once.
    pub fn able(&self, kind: Kind, fits: impl Fn(&Descriptor) -> bool) -> Able {
        let all = self.all_plugins(|| {
            let files = Discovery::from_environment().scan(self);
            let plugins = files.iter().flat_map(|file| {
                let plugins = file.plugins.iter().flat_map(|found| &found.descriptors);
                plugins.map(move |plugin| (file, plugin))
            });
            // One that is shadowed by another is not what its name stands for.
            let is_used = |file: &Discovered, plugin| {
                first_with(&files, plugin).is_some_and(|first| first.file == file.file)
            };
            let used = plugins.filter(|(file, plugin)| is_used(file, plugin));
            used.map(|(_, plugin)| plugin.clone()).collect()
        });
        let fitting = all
            .iter()
            .filter(|plugin| plugin.kind == kind && !plugin.is_for_measuring() && fits(plugin));
        Able {
            kind,
            ids: fitting.map(|plugin| plugin.id.clone()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hint_names_a_dozen_and_says_where_there_is_none() {
        let able = |count: usize| Able {
            kind: Kind::FailPolicy,
            ids: (0..count).map(|number| format!("p{number}")).collect(),
        };
        assert_eq!(able(0).to_string(), "no installed fail policy does");
        assert_eq!(able(2).to_string(), "fail policies that do: p0, p1");
        assert!(able(15).to_string().ends_with("p11 and 3 more"));
        assert_eq!(able(0).named(), None);
    }
}
