//! Checks who may open a WebSocket. Otherwise any web page in the user's browser could drive the tools.

use axum::http::{HeaderMap, header};

/// Accepts a request whose page came from this server (Origin names the host of the request) or from one of
/// `allowed` (`http://lab:8080`). Programs other than browsers send no Origin.
///
/// A server that listens on loopback also requires a loopback name in Host. Otherwise a foreign name that
/// resolves to 127.0.0.1 would pass as same origin.
pub(crate) fn is_allowed(headers: &HeaderMap, allowed: &[String], loopback_only: bool) -> bool {
    let host = text(headers, header::HOST);
    if loopback_only && !host.is_some_and(is_loopback_name) {
        return false;
    }
    let Some(origin) = text(headers, header::ORIGIN) else { return true };
    if allowed.iter().any(|one| one.trim_end_matches('/') == origin) {
        return true;
    }
    let from = origin.split_once("://").map(|(_, rest)| rest);
    from.is_some() && from == host
}

fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

fn is_loopback_name(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(v6) => v6.split(']').next().unwrap_or_default(),
        None => host.rsplit_once(':').map_or(host, |(name, _)| name),
    };
    name == "localhost" || name.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut map = HeaderMap::new();
        map.insert(header::HOST, host.parse().unwrap());
        if let Some(origin) = origin {
            map.insert(header::ORIGIN, origin.parse().unwrap());
        }
        map
    }

    #[test]
    fn same_origin_passes_and_others_do_not() {
        let own = headers("127.0.0.1:8080", Some("http://127.0.0.1:8080"));
        assert!(is_allowed(&own, &[], true));
        assert!(is_allowed(&headers("localhost:8080", None), &[], true));
        assert!(is_allowed(&headers("[::1]:8080", Some("http://[::1]:8080")), &[], true));
        let foreign = headers("127.0.0.1:8080", Some("http://evil.example"));
        assert!(!is_allowed(&foreign, &[], true));
        assert!(!is_allowed(&headers("127.0.0.1:8080", Some("null")), &[], true));
        assert!(is_allowed(&foreign, &["http://evil.example".into()], true));
    }

    #[test]
    fn rebound_names_do_not_reach_a_loopback_server() {
        let rebound = headers("evil.example:8080", Some("http://evil.example:8080"));
        assert!(!is_allowed(&rebound, &[], true));
        assert!(is_allowed(&headers("lab:8080", Some("http://lab:8080")), &[], false));
    }
}
