//! Files of other tools that are known and not read: what they are, and what to do with them.

use regex::bytes::Regex;
use std::sync::LazyLock;

use crate::InputError;

/// A kind of file that is not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Foreign {
    is: &'static str,
    hint: &'static str,
    /// The marks of the text: a pattern of its begin, or of lines that it all has.
    begin: &'static str,
    lines: &'static [&'static str],
}

const RASTER: &str = "write a map of letters of it, a letter per pixel, . for free and @ for occupied ones (unknown \
                      ones as you want them); `fleetyard world convert MAP WORLD --cell-size RESOLUTION` makes a \
                      world of that";

const KINDS: [Foreign; 5] = [
    Foreign {
        is: "a map of ROS's map_server: an image with its resolution and origin",
        hint: RASTER,
        begin: "",
        lines: &["image", "resolution"],
    },
    Foreign {
        is: "a picture in PGM or a format like it, as ROS's map_server has them",
        hint: RASTER,
        begin: r"^P[1-7]\s+(#.*\n|[0-9])",
        lines: &[],
    },
    Foreign {
        is: "a problem of db-CBS, with its environment and robots",
        hint: "write its obstacles as a world file and its robots as a task file (docs/worlds.md); \
               `fleetyard run --task TASK --planner db-cbs` plans it",
        begin: "",
        lines: &["environment", "robots"],
    },
    Foreign {
        is: "an instance of libMultiRobotPlanning on a roadmap",
        hint: "write its vertices and edges as fleetyard.roadmap/1 (docs/formats.md) and its agents as a task file \
               (docs/worlds.md#task-files); `fleetyard run --task` plans it on the roadmap",
        begin: "",
        lines: &["agents", "roadmap"],
    },
    Foreign {
        is: "a configuration of Continuous-CBS",
        hint: "give its settings as options of the planner, as in `--planner ccbs`",
        begin: r"^(?s)<.*<algorithm>",
        lines: &[],
    },
];

/// The kind of a text, if it is one of those.
pub(crate) fn foreign(bytes: &[u8]) -> Option<Foreign> {
    /// Bytes that decide it.
    const HEAD: usize = 1 << 16;
    static PATTERNS: LazyLock<Vec<Vec<Regex>>> = LazyLock::new(|| {
        let patterns = KINDS.iter().map(|kind| {
            let lines = kind.lines.iter().map(|key| format!("(?m)^{key} *:"));
            let begin = Some(kind.begin.to_owned()).filter(|begin| !begin.is_empty());
            let patterns = begin.into_iter().chain(lines);
            patterns
                .filter_map(|pattern| Regex::new(&pattern).ok())
                .collect()
        });
        patterns.collect()
    });
    let text = bytes.trim_ascii_start();
    let text = &text[..text.len().min(HEAD)];
    let is = |patterns: &[Regex]| {
        !patterns.is_empty() && patterns.iter().all(|pattern| pattern.is_match(text))
    };
    let found = PATTERNS.iter().position(|patterns| is(patterns))?;
    Some(KINDS[found])
}

impl Foreign {
    /// The error about a file of this kind.
    pub(crate) fn refused(self, source: &str) -> InputError {
        InputError::new(source, format!("this is {}, which is not read", self.is)).hint(self.hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_known_by_its_text() {
        for (kind, text) in [
            (
                0,
                "image: map.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.0, -2.0, -nan]\n",
            ),
            (1, "P5\n# CREATOR: map_saver\n8 6\n255\n"),
            (1, "P2 8 6 255 0 0"),
            (
                2,
                "environment:\n  min: [0, 0]\nrobots:\n  - {type: unicycle}\n",
            ),
            (
                3,
                "agents:\n- {name: a, start: 'a'}\nroadmap:\n  edges: []\n",
            ),
            (4, "<?xml version=\"1.0\" ?>\n<root>\n<algorithm>\n"),
        ] {
            assert_eq!(foreign(text.as_bytes()), Some(KINDS[kind]), "{text}");
        }
        for text in [
            "",
            "type octile\nheight 1\n",
            "P6x",
            "image: a\n",
            "<root><agent/></root>",
        ] {
            assert_eq!(foreign(text.as_bytes()), None, "{text}");
        }
    }
}
