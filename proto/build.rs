//! Compiles `scindo/v1/*.proto` without protoc, and keeps the descriptor set for `rpc/schema`.

use std::{env, error::Error, fs, path::PathBuf};

use prost::Message as _;

const FILES: [&str; 8] = [
    "scindo/v1/common.proto",
    "scindo/v1/tool.proto",
    "scindo/v1/cut.proto",
    "scindo/v1/surface.proto",
    "scindo/v1/force.proto",
    "scindo/v1/server.proto",
    "scindo/v1/viewer.proto",
    "scindo/v1/record.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    for file in FILES {
        println!("cargo:rerun-if-changed={file}");
    }
    let descriptors = protox::compile(FILES, ["."])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("scindo_v1.binpb"), descriptors.encode_to_vec())?;
    prost_build::Config::new().bytes(["."]).enable_type_names().compile_fds(descriptors)?;
    Ok(())
}
