//! The commit of a folder, as git knows it.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A commit and the files that change when another one is checked out.
pub(crate) struct Commit {
    /// Ten hexadecimal digits, with `-modified` if files differ from it.
    pub name: String,
    /// Files of the repository to be watched.
    pub files: Vec<PathBuf>,
}

/// The commit that is checked out in `folder`; `None` outside of a repository, or without git.
pub(crate) fn of(folder: &Path) -> Option<Commit> {
    let name = git(folder, &["describe", "--always", "--exclude=*", "--abbrev=10", "--dirty=-modified"])?;
    let of_head = git(folder, &["symbolic-ref", "-q", "HEAD"]);
    let names = ["HEAD", "index", "packed-refs"].into_iter().map(str::to_owned).chain(of_head);
    let files = names.filter_map(|name| git(folder, &["rev-parse", "--git-path", &name]));
    let files = files.map(|file| folder.join(file)).filter(|file| file.exists()).collect();
    Some(Commit { name, files })
}

fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let words = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !words.is_empty()).then_some(words)
}
