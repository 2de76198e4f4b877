//! The layout check refuses changed contracts and says why.

#![allow(missing_docs, unsafe_code)]

use fleetyard_abi::layout::{self, LayoutCheck, RustLayout};
use fleetyard_faulty_changed_layout::{OTHER_RELEASE, added, renamed, retyped, same};

fn check(layout: &'static RustLayout) -> LayoutCheck {
    // SAFETY: the pointer points to a layout table.
    unsafe { layout::check(std::ptr::from_ref(layout).cast()) }
}

#[test]
fn a_changed_structure_is_found_and_named() {
    for (layout, wanted) in [
        (
            &added::LAYOUT,
            &[
                "Budget (",
                "72 bytes expected, 80 found",
                "9 fields expected, 10 found",
            ][..],
        ),
        (
            &retyped::LAYOUT,
            &["wall_ns", "type u64 expected, f64 found"],
        ),
        (
            &renamed::LAYOUT,
            &[
                "Instance (",
                "field `window_steps` expected, `horizon` found",
            ],
        ),
    ] {
        let LayoutCheck::Differs(report) = check(layout) else {
            panic!("{wanted:?}: not found");
        };
        println!("{report}\n");
        for text in wanted {
            assert!(report.contains(text), "{text}:\n{report}");
        }
        assert!(report.lines().count() <= 8, "{report}");
        assert!(report.lines().all(|line| line.len() < 160), "{report}");
    }
}

#[test]
fn a_copy_of_the_same_contract_is_the_same() {
    assert_eq!(check(&same::LAYOUT), LayoutCheck::Same);
}

#[test]
fn another_release_of_abi_stable_is_not_compared() {
    let LayoutCheck::NotComparable(reason) = check(&OTHER_RELEASE) else {
        panic!("compared");
    };
    assert!(reason.contains("abi_stable 0.12.0"), "{reason}");
}
