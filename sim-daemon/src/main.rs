//! `tightloop`: see `tightloop help`.

fn main() -> std::process::ExitCode {
    sim_daemon::environment::complete();
    std::process::ExitCode::from(sim_daemon::serve(std::env::args_os()) as u8)
}
