//! The binary `scindo`.

fn main() -> std::process::ExitCode {
    scindo::command::main()
}
