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

impl Operators {
    /// The same permission in the viewer's terms, for browsers.
    pub fn of_pages(self) -> scindo_view::Operators {
        match self {
            Self::All => scindo_view::Operators::All,
            Self::Loopback => scindo_view::Operators::Loopback,
            Self::None => scindo_view::Operators::None,
        }
    }

    /// zenoh's access control for the sessions of a server; `None` if nothing has to be kept out.
    pub fn access_control(self, keys: &KeySpace) -> Option<Value> {
        if self != Self::Loopback {
            return None;
        }
        // `**` does not match a chunk that begins with @.
        let foreign: Vec<String> = keys.every_foreign_rpc().into_iter().map(|(_, key)| key).collect();
        let everything = [vec!["**".to_owned(), keys.every_key()], foreign.clone()].concat();
        let questions: Vec<String> =
            Verb::ALL.into_iter().filter(|verb| !verb.is_order()).map(|v| keys.key(&Topic::Rpc(v))).collect();
        let asked = [questions, vec![keys.every_keyframe()], foreign].concat();
        let messages = [
            "put",
            "delete",
            "reply",
            "declare_subscriber",
            "declare_queryable",
            "liveliness_token",
            "liveliness_query",
            "declare_liveliness_subscriber",
        ];
        Some(json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": [
                { "id": "take-part", "permission": "allow", "flows": ["ingress", "egress"],
                  "messages": messages, "key_exprs": everything },
                { "id": "be-asked", "permission": "allow", "flows": ["egress"],
                  "messages": ["query"], "key_exprs": everything },
                { "id": "ask", "permission": "allow", "flows": ["ingress"],
                  "messages": ["query"], "key_exprs": asked },
                { "id": "order", "permission": "allow", "flows": ["ingress"],
                  "messages": ["query"], "key_exprs": everything },
            ],
            "subjects": [
                { "id": "everybody" },
                { "id": "this-machine", "interfaces": LOOPBACK },
                { "id": "this-machine-by-file", "link_protocols": ["unixsock-stream"] },
            ],
            "policies": [
                { "rules": ["take-part", "be-asked", "ask"], "subjects": ["everybody"] },
                { "rules": ["order"], "subjects": ["this-machine", "this-machine-by-file"] },
            ],
        }))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_takes_the_access_control_and_only_loopback_may_order() {
        let keys = KeySpace::new("scindo", "main").unwrap();
        let rules = Operators::Loopback.access_control(&keys).unwrap();
        let mut config = zenoh::Config::default();
        config.insert_json5("access_control", &rules.to_string()).unwrap();
        let of_everybody = &rules["rules"].as_array().unwrap()[..3];
        let orders: Vec<&Value> =
            of_everybody.iter().filter(|rule| rule["flows"] == json!(["ingress"])).collect();
        assert_eq!(orders.len(), 1);
        let keys = orders[0]["key_exprs"].to_string();
        assert!(
            keys.contains("rpc/info") && keys.contains("keyframe") && !keys.contains("rpc/reset"),
            "{keys}"
        );
        assert_eq!(Operators::All.access_control(&KeySpace::new("a", "b").unwrap()), None);
    }
}
