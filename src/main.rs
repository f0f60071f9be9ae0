//! The pointmill command: the command line with the built-in stages.

fn main() -> std::process::ExitCode {
    std::process::ExitCode::SUCCESS
}
