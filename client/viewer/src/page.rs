//! The embedded page, which `build.rs` wrote to `OUT_DIR/page`.

use std::path::Path;

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use rust_embed::RustEmbed;

#[derive(RustEmbed)]
#[folder = "$OUT_DIR/page"]
struct Page;

/// Allows only this page's own scripts, styles and WebSocket. Nothing is loaded from elsewhere.
const POLICY: &str = "default-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self' ws: wss:; \
                      img-src 'self' data: blob:; frame-ancestors 'self'";

/// Whether npm built the page. Otherwise the served page explains what to install.
pub(crate) fn is_built() -> bool {
    Page::get("viewer.js").is_some()
}

/// Serves a file of the page: the embedded one, or one from `folder` during work on the page.
pub(crate) fn serve(name: &str, folder: Option<&Path>) -> Response {
    let name = if name.is_empty() { "index.html" } else { name };
    let Some(bytes) = read(name, folder) else {
        return (StatusCode::NOT_FOUND, "no such file").into_response();
    };
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type(name))),
        (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
        (header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY)),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    ];
    (headers, bytes).into_response()
}

fn read(name: &str, folder: Option<&Path>) -> Option<Bytes> {
    // The page has no subfolders: a name with a separator or a leading dot is refused.
    if name.starts_with('.') || name.contains(['/', '\\']) {
        return None;
    }
    match folder {
        Some(folder) => std::fs::read(folder.join(name)).ok().map(Bytes::from),
        None => Page::get(name).map(|file| Bytes::from(file.data.into_owned())),
    }
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        _ => "text/plain; charset=utf-8",
    }
}
