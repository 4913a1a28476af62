//! Lines for the user. A reader that has gone (`scindo check … | head`) is no reason to fail.

/// Prints a line to standard output and goes on when nobody reads it.
macro_rules! say {
    ($($line:tt)*) => {{
        use std::io::Write as _;
        // The only failure is a closed pipe: whoever listened has heard enough.
        let _ = writeln!(std::io::stdout().lock(), $($line)*);
    }};
}

pub(crate) use say;
