//! The standard plugins as a program that speaks JSON over stdio.

fn main() -> std::process::ExitCode {
    let code = fleetyard_abi::serve::serve_stdio(fleetyard_plugins::catalog());
    u8::try_from(code).unwrap_or(1).into()
}
