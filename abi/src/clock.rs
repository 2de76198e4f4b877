//! The clock of deadlines.

/// Nanoseconds of `CLOCK_MONOTONIC`, the same clock in every process of the
/// machine.
#[allow(unsafe_code)]
pub fn monotonic_ns() -> u64 {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: the pointer is valid, and the clock exists on every supported
    // system; on failure `time` stays zero, which reads as long ago.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut time) };
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}
