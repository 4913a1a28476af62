//! The frame of every page, and how its files are written.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{html, interactive, style, view};

/// A self-contained page: `body` (HTML) with the styles and the script of plots, charts and pictures, and those of
/// the page itself (`own_style`, CSS).
pub fn page(title: &str, own_style: &str, body: &str) -> String {
    let [page, colours, plot, lines] = [style::PAGE, style::COLOURS, style::PLOT, style::LINES];
    let (interactive, script, pictures) = (interactive::STYLE, interactive::SCRIPT, view::style());
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>scindo · {}</title>\n<style>\n{page}{colours}{plot}{lines}{interactive}{pictures}{own_style}</style>\n\
         </head>\n<body>\n<main>\n{body}</main>\n{script}</body>\n</html>\n",
        html::escape(title)
    )
}

/// Writes files into a directory, which is made if it is missing. Each file is written completely or not at all.
///
/// # Errors
/// The file and the message of the system.
pub fn put(
    directory: &Path,
    files: impl IntoIterator<Item = (impl AsRef<str>, String)>,
) -> Result<(), (PathBuf, io::Error)> {
    fs::create_dir_all(directory).map_err(|error| (directory.to_owned(), error))?;
    for (name, text) in files {
        let name = name.as_ref();
        let (path, draft) = (directory.join(name), directory.join(format!("{name}.part")));
        let written = fs::write(&draft, text).and_then(|()| fs::rename(&draft, &path));
        written.map_err(|error| (path, error))?;
    }
    Ok(())
}
