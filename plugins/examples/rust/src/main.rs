//! The example plugins as an executable that speaks JSON over stdio.

fn main() -> std::process::ExitCode {
    let code = fleetyard_abi::serve::serve_stdio(fleetyard_example_rust::catalog());
    u8::try_from(code).unwrap_or(1).into()
}
