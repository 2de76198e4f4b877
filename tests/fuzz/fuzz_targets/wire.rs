#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fleetyard_fuzz::wire::run(data));

/// Tells LeakSanitizer to be quiet: a server reads in a thread whose end it does not wait
/// for, and what a thread frees when it ends looks like a leak until then.
#[unsafe(no_mangle)]
pub extern "C" fn __lsan_is_turned_off() -> i32 {
    1
}
