//! Permission to give orders (pause, step, reset, set). Everybody may watch and touch.
//!
//! A client cannot prove an identity yet, but its address is known. Orders are taken from this machine only,
//! unless `--operators` says otherwise. zenoh's access control rejects the queries of other clients before
//! anything of them is read. The relay of the page checks the address of the browser.

use clap::ValueEnum;
use scindo_proto::{KeySpace, Topic, Verb};
use serde_json::{Value, json};

/// Clients and browsers that may give orders.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Operators {
    /// Every client and every browser.
    All,
    /// Clients and browsers on this machine.
    #[default]
    Loopback,
    /// Nobody, not even clients on this machine.
    None,
}

/// Names of the loopback interface on different systems.
const LOOPBACK: [&str; 2] = ["lo", "lo0"];

/// Name of the clients that connect from this machine, among the subjects of access control.
const HERE: &str = "this-machine";

impl Operators {
    /// The same permission in the viewer's terms, for browsers.
    pub fn of_pages(self) -> scindo_view::Operators {
        match self {
            Self::All => scindo_view::Operators::All,
            Self::Loopback => scindo_view::Operators::Loopback,
            Self::None => scindo_view::Operators::None,
        }
    }

    /// zenoh's access control for the sessions of a server. Clients hear what the server says, not what other clients send
    /// to it: a flood, or a reader that has stopped, is a matter between one client and the server. Clients of other
    /// machines may not speak in the server's place.
    pub fn access_control(self, keys: &KeySpace) -> Value {
        // `**` does not match a chunk that begins with @.
        let foreign: Vec<String> = keys.every_foreign_rpc().into_iter().map(|(_, key)| key).collect();
        let everything = [vec!["**".to_owned(), keys.every_key()], foreign.clone()].concat();
        let questions: Vec<String> =
            Verb::ALL.into_iter().filter(|verb| !verb.is_order()).map(|v| keys.key(&Topic::Rpc(v))).collect();
        let asked = [questions, vec![keys.every_keyframe()], foreign].concat();
        let rule = |id: &str, flow: &str, messages: &[&str], keys: &[String]| json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys });
        let presence = ["liveliness_token", "liveliness_query", "declare_liveliness_subscriber"];
        let watching = [presence.as_slice(), &["declare_subscriber"]].concat();
        let answering = [presence.as_slice(), &["declare_queryable", "query", "reply"]].concat();
        let serving = [answering.as_slice(), &["declare_subscriber", "put", "delete"]].concat();
        let of_clients = [keys.every_key_of_clients()];
        let private = json!({ "id": "between-client-and-server", "permission": "deny", "flows": ["egress"],
            "messages": ["put", "delete"], "key_exprs": of_clients });
        let mut of_everybody =
            vec!["hear", "be-answered", "be-heard", "between-client-and-server", "watch", "say", "ask"];
        if self != Self::Loopback {
            // With nobody, the server itself refuses, and says so.
            of_everybody.push("order");
        }
        json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": [
                rule("hear", "egress", &["put", "delete"], &[keys.every_key()]),
                rule("be-answered", "egress", &answering, &everything),
                rule("be-heard", "egress", &["declare_subscriber"], &of_clients),
                private,
                rule("watch", "ingress", &watching, &everything),
                rule("say", "ingress", &["put"], &of_clients),
                rule("ask", "ingress", &["query"], &asked),
                rule("order", "ingress", &["query"], &everything),
                rule("serve", "ingress", &serving, &everything),
                rule("be-served", "egress", &serving, &everything),
            ],
            "subjects": [
                { "id": "everybody" },
                { "id": HERE, "interfaces": LOOPBACK },
                { "id": "this-machine-by-file", "link_protocols": ["unixsock-stream"] },
            ],
            "policies": [
                { "rules": of_everybody, "subjects": ["everybody"] },
                { "rules": ["order"], "subjects": [HERE, "this-machine-by-file"] },
            ],
        })
    }
}

/// Lets the session `id` of the server itself say and hear everything.
pub fn admit_server(rules: &mut Value, id: &str) {
    if let Some(subjects) = rules["subjects"].as_array_mut() {
        subjects.push(json!({ "id": "server", "zids": [id] }));
    }
    if let Some(policies) = rules["policies"].as_array_mut() {
        policies.push(json!({ "rules": ["serve", "be-served"], "subjects": ["server"] }));
    }
}

/// Changes the rules for a server with doors ([`crate::wire::door`]): a client that comes in over TCP on loopback is not on this
/// machine; those that are come in by a file.
pub fn behind_doors(rules: &mut Value) {
    for subject in rules["subjects"].as_array_mut().into_iter().flatten() {
        if subject["id"] == HERE {
            subject["link_protocols"] = json!(["quic", "udp", "tls", "ws"]);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_takes_the_access_control_and_only_loopback_may_order() {
        let keys = KeySpace::new("scindo", "main").unwrap();
        let rules = Operators::Loopback.access_control(&keys);
        let mut config = zenoh::Config::default();
        config.insert_json5("access_control", &rules.to_string()).unwrap();
        let mut behind = rules.clone();
        behind_doors(&mut behind);
        admit_server(&mut behind, "a1b2");
        config.insert_json5("access_control", &behind.to_string()).unwrap();
        assert!(behind.to_string().contains(r#"["quic","#), "{behind}");
        let rule = |id: &str| {
            let rules = rules["rules"].as_array().unwrap();
            rules.iter().find(|rule| rule["id"] == id).unwrap()["key_exprs"].to_string()
        };
        let asked = rule("ask");
        assert!(
            asked.contains("rpc/info") && asked.contains("keyframe") && !asked.contains("rpc/reset"),
            "{asked}"
        );
        assert!(!rules["policies"][0]["rules"].to_string().contains("order"), "{rules}");
        let all = Operators::All.access_control(&keys);
        assert!(all["policies"][0]["rules"].to_string().contains("order"), "{all}");
    }
}
