//! The binary `scindo-papers`, which `scindo` starts for some of its commands.

fn main() -> std::process::ExitCode {
    scindo_papers::command::main()
}
