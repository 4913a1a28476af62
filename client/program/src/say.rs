//! Lines for the user. A reader that closes the pipe early (`scindo check … | head`) is no failure.

/// Prints a line to standard output and ignores a closed pipe.
#[macro_export]
macro_rules! say {
    ($($line:tt)*) => {{
        use std::io::Write as _;
        // The only possible failure is a closed pipe: the reader has seen enough.
        let _ = writeln!(std::io::stdout().lock(), $($line)*);
    }};
}
