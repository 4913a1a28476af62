//! `/metrics` over HTTP, at an address of its own.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::IntoResponse;
use axum::routing::get;
use scindo_view::Door;
use tokio::net::TcpListener;
use tokio::runtime::Runtime;

use super::Metrics;
use crate::error::RuntimeError;

/// What Prometheus expects of this format.
const OPEN_METRICS: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// Serves `metrics` at `address` as long as `runtime` lives. Returns the address, whose port may have been chosen.
///
/// # Errors
/// If the address is taken.
pub fn start(
    runtime: &Runtime,
    address: SocketAddr,
    metrics: Arc<Metrics>,
) -> Result<SocketAddr, RuntimeError> {
    let failed =
        |e: std::io::Error| RuntimeError::Metrics { address: address.to_string(), reason: e.to_string() };
    let listener = runtime.block_on(TcpListener::bind(address)).map_err(failed)?;
    let bound = listener.local_addr().map_err(failed)?;
    let router = Router::new().route("/metrics", get(page)).with_state(metrics);
    runtime.spawn(async move {
        // The same bounds on silent and idle connections as at the page.
        if let Err(error) = axum::serve(Door::new(listener), router).await {
            tracing::error!(%error, "the metrics ended");
        }
    });
    Ok(bound)
}

async fn page(State(metrics): State<Arc<Metrics>>) -> impl IntoResponse {
    ([(CONTENT_TYPE, OPEN_METRICS)], metrics.text())
}
