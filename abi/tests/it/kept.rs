//! Contract 1.0 as plugins were built with it stands: `tests/kept/1.0` has its header, the layout
//! that compilers gave it, and a library that is written on it. The conformance kit runs the
//! library (`tests/cases/conformance.rs`).

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use crate::header::{COMPILERS, installed, root, strict, succeed};

/// Constants and structures of a header, without comments and with one blank for many.
#[derive(Debug, Default)]
struct Declarations {
    constants: BTreeMap<String, String>,
    /// Declarations of fields, in their order.
    structures: BTreeMap<String, Vec<String>>,
}

fn without_comments(mut text: &str) -> String {
    let mut kept = String::new();
    while let Some((before, rest)) = text.split_once("/*") {
        kept.push_str(before);
        text = rest.split_once("*/").expect("comments end").1;
    }
    kept + text
}

fn blanks(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl Declarations {
    fn read(header: &Path) -> Declarations {
        let text = without_comments(&std::fs::read_to_string(header).expect("a header"));
        let mut declared = Declarations::default();
        for line in text
            .lines()
            .filter_map(|line| line.strip_prefix("#define "))
        {
            let (name, value) = line.split_once(' ').unwrap_or((line, ""));
            declared.constants.insert(name.to_owned(), blanks(value));
        }
        for structure in text.split("typedef struct ").skip(1) {
            let (name, rest) = structure.split_once('{').expect("a structure's body");
            let (body, _) = rest.split_once('}').expect("a structure ends");
            let fields = body
                .split(';')
                .map(blanks)
                .filter(|field| !field.is_empty());
            let known = declared
                .structures
                .insert(name.trim().to_owned(), fields.collect());
            assert!(known.is_none(), "{name} is declared twice");
        }
        declared
    }
}

/// The name that a field's declaration gives it.
fn field_name(declaration: &str) -> &str {
    let end = match declaration.split_once("(*") {
        Some((_, name)) => name,
        None => declaration.rsplit([' ', '*']).next().expect("a name"),
    };
    end.split(')').next().expect("a name")
}

/// Sizes of structures and places of their fields, as a compiler has them: a line each.
fn layout(declared: &Declarations, include: &Path) -> Vec<String> {
    let mut program = "#include \"fleetyard.h\"\n#include <stdio.h>\nint main(void) {\n".to_owned();
    for (name, fields) in &declared.structures {
        writeln!(program, "printf(\"{name} %zu\\n\", sizeof({name}));").unwrap();
        for field in fields.iter().map(|field| field_name(field)) {
            writeln!(
                program,
                "printf(\"{name}.{field} %zu %zu\\n\", offsetof({name}, {field}), \
                 sizeof((({name} *)0)->{field}));"
            )
            .unwrap();
        }
    }
    program.push_str("return 0;\n}\n");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let source = folder.path().join("layout.c");
    std::fs::write(&source, program).expect("write the program");
    let (compiler, standard, ..) = COMPILERS
        .into_iter()
        .find(|(compiler, _, language, _)| *language == "c" && installed(compiler))
        .expect("a C compiler is installed");
    let built = folder.path().join("layout");
    succeed(
        strict(compiler, standard, include)
            .arg(&source)
            .arg("-o")
            .arg(&built),
    );
    let printed = succeed(&mut Command::new(&built));
    printed.lines().map(str::to_owned).collect()
}

fn kept() -> std::path::PathBuf {
    root().join("tests/kept/1.0")
}

#[test]
fn declarations_of_the_first_release_stand() {
    let first = Declarations::read(&kept().join("fleetyard.h"));
    let present = Declarations::read(&root().join("include/fleetyard.h"));
    assert!(first.structures.len() >= 30 && first.constants.len() >= 80);
    for (name, value) in &first.constants {
        // The minor version is what may grow.
        if name != "FLEETYARD_ABI_MINOR" {
            assert_eq!(present.constants.get(name), Some(value), "{name}");
        }
    }
    for (name, fields) in &first.structures {
        let found = present.structures.get(name);
        let found = found.unwrap_or_else(|| panic!("{name} is gone"));
        let common = &found[..fields.len().min(found.len())];
        assert_eq!(common, fields.as_slice(), "{name}");
        // What does not begin with its size is an element of arrays, and never grows.
        if !fields[0].ends_with(" struct_size") {
            assert_eq!(found.len(), fields.len(), "{name}");
        }
    }
}

#[test]
fn the_layout_of_the_first_release_stands() {
    let first = Declarations::read(&kept().join("fleetyard.h"));
    let recorded = std::fs::read_to_string(kept().join("layout.txt")).expect("the layout");
    let recorded: Vec<&str> = recorded.lines().collect();
    assert_eq!(layout(&first, &kept()), recorded);
    // Structures may be longer by now, but what was in them is where it was.
    let present = layout(&first, &root().join("include"));
    assert_eq!(present.len(), recorded.len());
    for (present, recorded) in present.iter().zip(recorded) {
        if recorded.contains('.') {
            assert_eq!(present, recorded);
        } else {
            let size = |line: &str| {
                let (name, size) = line.split_once(' ').expect("a name and a size");
                (name.to_owned(), size.parse::<usize>().expect("a size"))
            };
            let (present, recorded) = (size(present), size(recorded));
            assert!(
                present.0 == recorded.0 && present.1 >= recorded.1,
                "{present:?}"
            );
        }
    }
}
