//! Files of the shipped scenes that are inside the program.

use std::path::Path;

/// What a path to such a file begins with.
const MARK: &str = "shipped:";

const FILES: [(&str, &[u8]); 2] = [
    ("liver-tissue.jpg", include_bytes!("../../scenes/liver-tissue.jpg")),
    ("organ.obj", include_bytes!("../../scenes/organ.obj")),
];

/// The bytes of the file inside the program that `path` names, in whichever folder; none if it names one on a disk.
pub(crate) fn inside(path: &Path) -> Option<&'static [u8]> {
    let name = path.file_name()?.to_str()?.strip_prefix(MARK)?;
    FILES.iter().find(|(file, _)| *file == name).map(|(_, bytes)| *bytes)
}

/// The text of a shipped scene with its files named as those inside the program.
pub(crate) fn with_files_inside(scene: &str) -> String {
    let name = |text: String, file: &str| text.replace(&format!("\"{file}\""), &format!("\"{MARK}{file}\""));
    FILES.iter().fold(scene.to_owned(), |text, (file, _)| name(text, file))
}
