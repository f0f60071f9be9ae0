//! The pointmill command: the command line with the built-in stages.

fn main() -> std::process::ExitCode {
    pointmill::cli::main(&pointmill::Registry::builtin())
}
