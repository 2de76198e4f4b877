//! Figures that plugins report, and their domains.

use fleetyard_abi::figures::{check_figure, longest_call_ns};

#[test]
fn figures_have_domains() {
    for (name, value) in [
        ("expansions", 0.0),
        ("expansions", -0.0),
        ("generated", 1e300),
        ("lower_bound", 2.5),
        ("gap", -1.0),
        ("gap", f64::NAN),
    ] {
        assert_eq!(check_figure(name, value), Ok(()), "{name} {value}");
    }
    for (name, value) in [
        ("expansions", -5.0),
        ("nodes", 0.5),
        ("iterations", f64::NAN),
        ("lower_bound", f64::INFINITY),
        ("claimed_makespan", -1e-9),
    ] {
        let reason = check_figure(name, value).unwrap_err();
        assert!(
            reason.contains(name) && reason.contains("from 0"),
            "{reason}"
        );
    }
}

#[test]
fn no_call_is_longer_than_it_took() {
    assert_eq!(longest_call_ns(0), 1_000_000);
    assert_eq!(longest_call_ns(1_000_000_000), 1_002_000_000);
    assert_eq!(longest_call_ns(u64::MAX), u64::MAX);
}
