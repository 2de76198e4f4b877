//! View files: the operator that made a view, its parameters and digests.

use fleetyard_views::{Representation, ViewSpec, read_view};

use super::check_error;

const SOURCE: &str = "a.view.json";

/// Reads a view file. What it describes is not derived, which may take any time.
pub fn run(data: &[u8]) {
    let file = match read_view(SOURCE, data) {
        Ok(file) => file,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    assert_ne!(file.spec.representation(), Representation::Continuous);
    if let ViewSpec::Roadmap(spec) = &file.spec {
        let numbers = [spec.spacing_m, spec.speed_m_per_s];
        assert!(numbers.into_iter().flatten().all(f64::is_finite));
    }
    assert_eq!(read_view(SOURCE, data).as_ref(), Ok(&file));
}
