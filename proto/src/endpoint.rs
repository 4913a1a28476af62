//! Endpoints of the two connections. Poses, contacts and cuts go to the *haptic* endpoint, surfaces and
//! reports to the *bulk* endpoint one port above. A mesh therefore never delays a force. A client that
//! reaches only the haptic endpoint still receives everything, relayed.

/// The default haptic endpoint of a server.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

/// The bulk endpoint that belongs to a haptic endpoint: the next port, or the file with `.bulk` after its name. `None` if
/// the endpoint has no port that could be raised (port 0, port 65535).
pub fn bulk_endpoint(haptic: &str) -> Option<String> {
    if haptic.starts_with("unixsock-stream/") {
        return Some(format!("{haptic}.bulk"));
    }
    let address_end = haptic.find(['?', '#']).unwrap_or(haptic.len());
    let (address, options) = haptic.split_at(address_end);
    let (host, port) = address.rsplit_once(':')?;
    let port: u16 = port.parse().ok().filter(|&p| p != 0)?;
    Some(format!("{host}:{}{options}", port.checked_add(1)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bulk_endpoint_is_one_port_above() {
        assert_eq!(bulk_endpoint("tcp/127.0.0.1:7447").as_deref(), Some("tcp/127.0.0.1:7448"));
        assert_eq!(bulk_endpoint("quic/[::1]:9?prio=1-7").as_deref(), Some("quic/[::1]:10?prio=1-7"));
        assert_eq!(bulk_endpoint("tcp/127.0.0.1:0"), None);
        assert_eq!(bulk_endpoint("tcp/127.0.0.1:65535"), None);
        let file = "unixsock-stream//tmp/scindo";
        assert_eq!(bulk_endpoint(file).as_deref(), Some("unixsock-stream//tmp/scindo.bulk"));
    }
}
