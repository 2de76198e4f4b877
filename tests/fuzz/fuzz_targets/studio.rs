#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| fleetyard_fuzz::studio::run(data));
