//! What the build script finds out about the commit.

#[path = "../commit.rs"]
mod commit;

use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::Command;

fn git(folder: &Path, arguments: &[&str]) -> Result<(), Box<dyn Error>> {
    let who = ["-c", "user.name=a", "-c", "user.email=a@localhost"];
    let status = Command::new("git").arg("-C").arg(folder).args(who).args(arguments).status()?;
    status.success().then_some(()).ok_or_else(|| format!("git {arguments:?}").into())
}

#[test]
fn a_commit_is_named_and_changes_are_told() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    assert!(commit::of(folder.path()).is_none(), "a folder without a repository has no commit");
    git(folder.path(), &["init", "-q"])?;
    assert!(commit::of(folder.path()).is_none(), "a repository without a commit has none");
    fs::write(folder.path().join("file"), "one")?;
    git(folder.path(), &["add", "."])?;
    git(folder.path(), &["commit", "-q", "-m", "one"])?;
    let first = commit::of(folder.path()).ok_or("a commit")?;
    assert!(first.name.len() == 10 && first.name.bytes().all(|b| b.is_ascii_hexdigit()), "{}", first.name);
    assert!(first.files.len() >= 3, "{:?}", first.files);
    fs::write(folder.path().join("file"), "two")?;
    let modified = commit::of(folder.path()).ok_or("a commit")?.name;
    assert_eq!(modified, format!("{}-modified", first.name));
    git(folder.path(), &["commit", "-q", "-a", "-m", "two"])?;
    assert_ne!(commit::of(folder.path()).ok_or("a commit")?.name, first.name);
    Ok(())
}
