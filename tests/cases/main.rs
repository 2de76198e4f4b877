//! Tables whose every row is a test with a name of its own: files, command lines and plugins that
//! are wrong, the conformance kit, and the modules of fleets by every attachment.
//!
//! Whatever is wrong, the exit code says whose fault it is, the message names the fault and its
//! place, no process is left running, and no half-written file remains.

mod command_line;
mod conformance;
mod files;
mod fuzz;
mod modules;
mod plugins;
mod public;

use fleetyard_testkit::Ended;
use libtest_mimic::{Arguments, Trial};

/// The tests of all tables.
#[derive(Default)]
struct Tests(Vec<Trial>);

impl Tests {
    /// A test that fails when `test` panics. Words of the name are joined by hyphens.
    fn add(&mut self, name: &str, test: impl FnOnce() + Send + 'static) {
        let trial = Trial::test(name.replace(' ', "-"), || {
            test();
            Ok(())
        });
        self.0.push(trial);
    }
}

/// Fails unless every text stands on standard error.
#[track_caller]
fn says(ended: &Ended, texts: &[&str]) {
    for text in texts {
        assert!(ended.stderr.contains(text), "no `{text}`: {ended}");
    }
    assert!(!ended.stderr.contains("panicked"), "{ended}");
}

fn main() {
    modules::intercept();
    let mut tests = Tests::default();
    files::add(&mut tests);
    command_line::add(&mut tests);
    plugins::add(&mut tests);
    public::add(&mut tests);
    conformance::add(&mut tests);
    fuzz::add(&mut tests);
    modules::add(&mut tests);
    let mut arguments = Arguments::from_args();
    // As the standard harness has it.
    let threads = std::env::var("RUST_TEST_THREADS").ok();
    let threads = threads.and_then(|threads| threads.parse().ok());
    arguments.test_threads = arguments.test_threads.or(threads);
    libtest_mimic::run(&arguments, tests.0).exit();
}
