//! Where a server would listen, who could reach it there, whether the ports are free, and whether a router answers.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs as _, UdpSocket};
use std::time::Duration;

use super::Finding;

/// How long a router may take to accept a connection.
const PATIENCE: Duration = Duration::from_secs(2);

/// Who reaches an address.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Programs on this machine.
    Loopback,
    /// Machines of a private network (RFC 1918, RFC 4193, link-local).
    Private,
    /// Every machine that has a route to this one.
    Anyone,
}

/// What protects an endpoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Guard {
    /// Clients show a certificate that the laboratory signed.
    pub certificates: bool,
    /// zenoh's access control is on.
    pub access_control: bool,
}

/// Who reaches `address`. The unspecified address stands for every address of the machine.
pub fn reach(address: IpAddr) -> Reach {
    match address {
        address if address.is_loopback() => Reach::Loopback,
        IpAddr::V4(v4) if v4.is_private() || v4.is_link_local() => Reach::Private,
        IpAddr::V6(v6) if v6.is_unique_local() || v6.is_unicast_link_local() => Reach::Private,
        IpAddr::V6(v6) => v6.to_ipv4_mapped().map_or(Reach::Anyone, |v4| reach(IpAddr::V4(v4))),
        IpAddr::V4(_) => Reach::Anyone,
    }
}

/// Looks at an endpoint of zenoh, such as `quic/0.0.0.0:7447`, at which a server would listen.
pub fn endpoint(endpoint: &str, guard: Guard) -> Vec<Finding> {
    let (protocol, addresses) = match parts(endpoint) {
        Ok(parts) => parts,
        Err(reason) => return vec![misread(endpoint, &reason)],
    };
    let Some(&address) = addresses.first() else {
        return vec![misread(endpoint, "the name has no address")];
    };
    let guard = Guard { certificates: guard.certificates && protocol == "quic", ..guard };
    vec![reached("endpoint", endpoint, address, guard), free(endpoint, protocol, address)]
}

/// Looks at the address at which a page would be served. A page has no certificates.
pub fn page(address: SocketAddr) -> Vec<Finding> {
    let words = format!("page at http://{address}");
    let who = match reach(address.ip()) {
        Reach::Loopback => Finding::ok("page", format!("{words}: reached only from this machine")),
        reach => Finding::warning(
            "page",
            format!("{words}: reached by {}, without encryption", words_of(reach)),
            "Put a proxy with HTTPS before it, or serve it at 127.0.0.1",
        ),
    };
    vec![who, free(&words, "tcp", address)]
}

/// Tries to connect to a router or server.
pub fn connect(endpoint: &str) -> Finding {
    let (protocol, addresses) = match parts(endpoint) {
        Ok(parts) => parts,
        Err(reason) => return misread(endpoint, &reason),
    };
    if protocol == "quic" {
        return Finding::warning(
            "router",
            format!("{endpoint}: {protocol} does not tell whether somebody is there"),
            "Start a client to find out",
        );
    }
    let mut failure = "the name has no address".to_owned();
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(_) => return Finding::ok("router", format!("{endpoint}: somebody listens at {address}")),
            Err(error) => failure = error.to_string(),
        }
    }
    Finding::wrong(
        "router",
        format!("{endpoint}: {failure}"),
        "Start the router, correct the address, or open the port in the firewall between here and there",
    )
}

/// Protocol and addresses of an endpoint.
fn parts(endpoint: &str) -> Result<(&str, Vec<SocketAddr>), String> {
    let (protocol, rest) = endpoint.split_once('/').ok_or("expected PROTOCOL/HOST:PORT")?;
    if !matches!(protocol, "tcp" | "quic") {
        return Err(format!("scindo speaks tcp, and quic where there are certificates, not '{protocol}'"));
    }
    let host = rest.split(['?', '#']).next().unwrap_or(rest);
    let addresses = host.to_socket_addrs().map_err(|error| error.to_string())?;
    Ok((protocol, addresses.collect()))
}

fn misread(endpoint: &str, reason: &str) -> Finding {
    Finding::wrong("endpoint", format!("'{endpoint}': {reason}"), "Write for example tcp/127.0.0.1:7447")
}

fn words_of(reach: Reach) -> &'static str {
    match reach {
        Reach::Loopback => "this machine",
        Reach::Private => "the private network",
        Reach::Anyone => "anyone with a route to this machine",
    }
}

fn reached(about: &'static str, endpoint: &str, address: SocketAddr, guard: Guard) -> Finding {
    let who = words_of(reach(address.ip()));
    let Guard { certificates, access_control } = guard;
    match (reach(address.ip()), certificates, access_control) {
        (Reach::Loopback, ..) => Finding::ok(about, format!("{endpoint}: reached only from this machine")),
        (_, true, true) => {
            Finding::ok(about, format!("{endpoint}: reached by {who}, with a certificate and access control"))
        }
        (_, true, false) => Finding::warning(
            about,
            format!("{endpoint}: reached by {who}; every holder of a certificate may do everything"),
            "Use the server.json5 that scindo certs makes; it holds access control",
        ),
        (..) => Finding::warning(
            about,
            format!("{endpoint}: reached by {who}; whoever reaches it may watch, touch and cut"),
            "Set up certificates with scindo certs, or listen at 127.0.0.1",
        ),
    }
}

fn free(what: &str, protocol: &str, address: SocketAddr) -> Finding {
    let opened: io::Result<()> = match protocol {
        "quic" => UdpSocket::bind(address).map(drop),
        _ => TcpListener::bind(address).map(drop),
    };
    let port = address.port();
    let Err(error) = opened else {
        return Finding::ok("port", format!("{port} is free"));
    };
    let next = match error.kind() {
        ErrorKind::AddrInUse => {
            format!("Find its owner with ss -lnp 'sport = :{port}', or choose another port")
        }
        ErrorKind::AddrNotAvailable => "Choose an address of this machine; ip address lists them".to_owned(),
        ErrorKind::PermissionDenied => "Choose a port of 1024 or above".to_owned(),
        _ => "Choose another address".to_owned(),
    };
    Finding::wrong("port", format!("{what}: {error}"), next)
}
