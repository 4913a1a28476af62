//! The web server: `/` serves the page, `/ws` the stream, `/healthz` the status.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{ConnectInfo, Path, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use axum::{Json, Router};
use scindo_proto::limits::MAX_TOPOLOGY_BYTES;
use tokio::net::TcpListener;

use crate::door::{Door, From};
use crate::hub::Hub;
use crate::socket::Rights;
use crate::{ViewError, origin, page, socket};

/// Read buffer of a socket [bytes], allocated per browser. Pages send only small messages.
const READ_BUFFER: usize = 8 * 1024;

/// Settings of the web server; part of [`crate::ViewConfig`].
#[derive(Debug, Clone)]
pub struct WebConfig {
    /// Address to listen on. Port 0 takes a free one.
    pub listen: SocketAddr,
    /// Origins of other pages that may connect (`http://lab:8080`), beside this server's own.
    pub allow_origins: Vec<String>,
    /// Most browsers at a time.
    pub max_browsers: usize,
    /// Pages may watch, but not touch, cut or call.
    pub read_only: bool,
    /// Which pages may pause, step, reset and set.
    pub operators: Operators,
    /// Folder from which the page is served instead of the embedded one, for work on the page.
    pub page_folder: Option<PathBuf>,
}

impl Default for WebConfig {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            allow_origins: Vec::new(),
            max_browsers: 32,
            read_only: false,
            operators: Operators::default(),
            page_folder: None,
        }
    }
}

/// Browsers that may give orders: pause, step, reset, set.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Operators {
    /// Every browser.
    All,
    /// Browsers on this machine.
    #[default]
    Loopback,
    /// Nobody.
    None,
}

impl Operators {
    /// Whether a browser at this address may give orders.
    pub fn admit(self, address: SocketAddr) -> bool {
        match self {
            Self::All => true,
            Self::Loopback => address.ip().to_canonical().is_loopback(),
            Self::None => false,
        }
    }
}

/// A web server whose port is bound.
#[derive(Debug)]
pub struct WebServer {
    listener: TcpListener,
    address: SocketAddr,
    app: Arc<App>,
}

#[derive(Debug)]
struct App {
    hub: Arc<Hub>,
    config: WebConfig,
    upstream: String,
}

impl WebServer {
    /// Binds the port. `upstream` describes where the server is looked for.
    pub async fn bind(config: WebConfig, hub: Arc<Hub>, upstream: String) -> Result<Self, ViewError> {
        let failed = |source| ViewError::Listen { address: config.listen, source };
        let listener = TcpListener::bind(config.listen).await.map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address, app: Arc::new(App { hub, config, upstream }) })
    }

    /// Address that the server listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves until the task is dropped.
    pub async fn run(self) -> Result<(), ViewError> {
        let address = self.address;
        let router = Router::new()
            .route("/", get(index))
            .route("/ws", any(open_socket))
            .route("/healthz", get(health))
            .route("/{name}", get(file))
            .with_state(self.app);
        let service = router.into_make_service_with_connect_info::<From>();
        axum::serve(Door::new(self.listener), service)
            .await
            .map_err(|source| ViewError::Listen { address, source })
    }
}

async fn index(State(app): State<Arc<App>>) -> Response {
    page::serve("index.html", app.config.page_folder.as_deref())
}

async fn file(State(app): State<Arc<App>>, Path(name): Path<String>) -> Response {
    page::serve(&name, app.config.page_folder.as_deref())
}

async fn health(State(app): State<Arc<App>>) -> Response {
    Json(serde_json::json!({
        "ok": true,
        "version": env!("CARGO_PKG_VERSION"),
        "connected": app.hub.connected(),
        "upstream": app.upstream,
        "browsers": app.hub.browsers(),
        "page": if page::is_built() || app.config.page_folder.is_some() { "built" } else { "missing" },
    }))
    .into_response()
}

async fn open_socket(
    State(app): State<Arc<App>>,
    ConnectInfo(From(visitor)): ConnectInfo<From>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !origin::is_allowed(&headers, &app.config.allow_origins, app.config.listen.ip().is_loopback()) {
        let words = "this page comes from another origin; start the viewer with --allow-origin to admit it";
        return (StatusCode::FORBIDDEN, words).into_response();
    }
    let Some(seat) = app.hub.join(app.config.max_browsers) else {
        return (
            StatusCode::SERVICE_UNAVAILABLE,
            "the maximum number of browsers is connected; raise it with \
            --max-browsers",
        )
            .into_response();
    };
    visitor.becomes_browser();
    let rights = Rights {
        read_only: app.config.read_only,
        operator: !app.config.read_only && app.config.operators.admit(visitor.address),
    };
    upgrade
        .max_message_size(socket::MAX_UP_BYTES)
        .max_frame_size(socket::MAX_UP_BYTES)
        .read_buffer_size(READ_BUFFER)
        .max_write_buffer_size(2 * MAX_TOPOLOGY_BYTES)
        .on_upgrade(move |stream| {
            let (hub, upstream) = (Arc::clone(&app.hub), app.upstream.clone());
            socket::serve(stream, hub, seat, upstream, rights)
        })
}
