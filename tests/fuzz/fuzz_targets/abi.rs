#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fleetyard_fuzz::abi::run(data));

/// Tells LeakSanitizer to be quiet: what a library is told of the host at its start is its
/// own for ever.
#[unsafe(no_mangle)]
pub extern "C" fn __lsan_is_turned_off() -> i32 {
    1
}
