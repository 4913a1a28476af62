//! Scene files: TOML or JSON in, checked objects out.
