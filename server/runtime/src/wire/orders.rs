//! Who may give orders: pause, step, reset, set. Everybody may watch and touch.
//!
//! There is no identity yet that a client could prove, but its address is known: orders are taken from this
//! machine, unless `--operators` says otherwise. zenoh's access control keeps the queries of others out before
//! anything is read of them; the page asks for the address of the browser.

use clap::ValueEnum;
use scindo_proto::{KeySpace, Topic, Verb};
use serde_json::{Value, json};

/// Who may give orders.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Operators {
    /// Every client and every browser.
    All,
    /// Clients and browsers on this machine.
    #[default]
    Loopback,
    /// Nobody.
    None,
}

/// Names that systems give to the loopback interface.
const LOOPBACK: [&str; 2] = ["lo", "lo0"];

impl Operators {
    /// Who among browsers may give orders.
    pub fn of_pages(self) -> scindo_view::Operators {
        match self {
            Self::All => scindo_view::Operators::All,
            Self::Loopback => scindo_view::Operators::Loopback,
            Self::None => scindo_view::Operators::None,
        }
    }

    /// zenoh's access control for the sessions of a server; none where nothing has to be kept out by it.
    pub fn access_control(self, keys: &KeySpace) -> Option<Value> {
        if self != Self::Loopback {
            return None;
        }
        // `**` does not match the chunk that begins with @.
        let session = keys.every_key();
        let everything = ["**".to_owned(), session];
        let questions: Vec<String> =
            Verb::ALL.into_iter().filter(|verb| !verb.is_order()).map(|v| keys.key(&Topic::Rpc(v))).collect();
        let asked = [questions, vec![keys.every_keyframe()]].concat();
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
