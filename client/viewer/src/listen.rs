//! Parses the address for browsers as people write it.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

/// Default port of the page.
pub(crate) const DEFAULT_PORT: u16 = 8080;

/// Reads `PORT`, `HOST` or `HOST:PORT`. The host is an IP address or `localhost`.
///
/// Without a host, only browsers on this machine can connect: `8080` and `:8080` are `127.0.0.1:8080`. The
/// default port is 8080.
///
/// # Errors
/// A description of the expected form, for a command line to print.
pub fn listen_address(text: &str) -> Result<SocketAddr, String> {
    let local = IpAddr::V4(Ipv4Addr::LOCALHOST);
    let text = text.trim();
    if let Ok(address) = text.parse::<SocketAddr>() {
        return Ok(address);
    }
    if let Some(host) = host(text) {
        return Ok(SocketAddr::new(host, DEFAULT_PORT));
    }
    let (before, port) = text.rsplit_once(':').unwrap_or(("", text));
    let digits = !port.is_empty() && port.bytes().all(|byte| byte.is_ascii_digit());
    let host = if before.is_empty() { Some(local) } else { host(before) };
    match (host, port.parse::<u16>()) {
        (Some(host), Ok(port)) if digits => Ok(SocketAddr::new(host, port)),
        (Some(_), Err(_)) if digits => Err(format!("port {port} is not between 0 (a free one) and 65535")),
        _ => Err("give PORT, HOST or HOST:PORT, where HOST is an IP address or localhost: \
                  8080, 127.0.0.1:8080, or 0.0.0.0:8080 for browsers of other machines"
            .to_owned()),
    }
}

fn host(text: &str) -> Option<IpAddr> {
    if text == "localhost" {
        return Some(IpAddr::V4(Ipv4Addr::LOCALHOST));
    }
    let bare = text.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    bare.unwrap_or(text).parse().ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::listen_address;

    #[test]
    fn an_address_is_understood_as_people_write_it() {
        for (written, meant) in [
            ("8080", "127.0.0.1:8080"),
            (":9000", "127.0.0.1:9000"),
            ("0", "127.0.0.1:0"),
            ("127.0.0.1", "127.0.0.1:8080"),
            ("0.0.0.0", "0.0.0.0:8080"),
            ("localhost", "127.0.0.1:8080"),
            ("localhost:81", "127.0.0.1:81"),
            ("10.0.0.1:82", "10.0.0.1:82"),
            ("::1", "[::1]:8080"),
            ("[::1]", "[::1]:8080"),
            ("[::1]:83", "[::1]:83"),
        ] {
            assert_eq!(listen_address(written).unwrap().to_string(), meant, "{written}");
        }
    }

    #[test]
    fn what_is_no_address_is_answered_with_the_form() {
        for wrong in ["", ":", "lab", "lab:8080", "127.0.0.1:", "127.0.0:80", "+80", "-1", "http://x"] {
            assert!(listen_address(wrong).unwrap_err().contains("HOST:PORT"), "{wrong}");
        }
        for wrong in ["65536", "localhost:99999"] {
            assert!(listen_address(wrong).unwrap_err().contains("65535"), "{wrong}");
        }
    }
}
