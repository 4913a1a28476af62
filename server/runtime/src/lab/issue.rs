//! Certificates: that of the laboratory, which signs those of server and clients.

use std::time::{Duration, SystemTime};

use rcgen::{
    BasicConstraints, Certificate, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};

/// A certificate and its private key, both as PEM.
#[derive(Debug, Clone)]
pub struct Papers {
    /// The certificate, in PEM.
    pub certificate: String,
    /// The key; only its owner may read it.
    pub key: String,
}

/// A certificate is valid from this time before it was made: the clocks of machines differ.
const CLOCKS_DIFFER: Duration = Duration::from_secs(3600);

/// Who can be reached under a certificate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holder<'a> {
    /// The server, at these host names and addresses.
    Server(&'a [String]),
    /// A client.
    Client,
}

/// The certificate of a laboratory, which signs others.
///
/// # Errors
/// If the cryptography fails.
pub fn authority(lab: &str, life: Duration) -> Result<Papers, rcgen::Error> {
    let key = KeyPair::generate()?;
    let mut params = params(&[], &format!("{lab} scindo"), life)?;
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    Ok(papers(&params.self_signed(&key)?, &key))
}

/// A certificate with the common name `name`, signed by `authority`, for `life` from now on.
///
/// # Errors
/// If `authority` is no certificate with its key, or a host name is none.
pub fn issue(
    authority: &Papers,
    name: &str,
    holder: Holder<'_>,
    life: Duration,
) -> Result<Papers, rcgen::Error> {
    let issuer = Issuer::from_ca_cert_pem(&authority.certificate, KeyPair::from_pem(&authority.key)?)?;
    let key = KeyPair::generate()?;
    let hosts = match holder {
        Holder::Server(hosts) => hosts,
        Holder::Client => &[],
    };
    let mut params = params(hosts, name, life)?;
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = match holder {
        // A server connects to routers, too.
        Holder::Server(_) => vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth],
        Holder::Client => vec![ExtendedKeyUsagePurpose::ClientAuth],
    };
    params.use_authority_key_identifier_extension = true;
    Ok(papers(&params.signed_by(&key, &issuer)?, &key))
}

fn params(hosts: &[String], name: &str, life: Duration) -> Result<CertificateParams, rcgen::Error> {
    let mut params = CertificateParams::new(hosts.to_vec())?;
    params.distinguished_name = rcgen::DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, name);
    let now = SystemTime::now();
    params.not_before = (now - CLOCKS_DIFFER).into();
    params.not_after = (now + life).into();
    Ok(params)
}

fn papers(certificate: &Certificate, key: &KeyPair) -> Papers {
    Papers { certificate: certificate.pem(), key: key.serialize_pem() }
}
