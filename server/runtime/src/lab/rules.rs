//! The access control of a laboratory, for the sessions of its server, and of a router that joins laboratories.
//!
//! Clients hear everything that the server says. What comes from a client is denied unless a rule allows it: to
//! subscribe and to ask questions for everybody; to publish under its own id for those who touch; orders for those who
//! may give them. Nobody but the server publishes surfaces, contacts and reports, or answers questions.
//!
//! A router holds each laboratory to its own realm, servers included.

use std::collections::BTreeMap;

use scindo_proto::{Chunk, KeySpace, Topic, Verb};
use serde_json::{Value, json};

use super::roles::LabRole;

const EVERY_MESSAGE: [&str; 9] = [
    "put",
    "delete",
    "query",
    "reply",
    "declare_subscriber",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];
const WATCHING: [&str; 3] = ["declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"];

/// Who may speak in one session.
#[derive(Debug, Clone)]
pub struct Seats {
    /// The keys under which the server publishes.
    pub keys: KeySpace,
    /// Common names that may say everything: its server, and a router with rules of its own.
    pub trusted: Vec<String>,
    /// Clients by id.
    pub clients: Vec<(Chunk, LabRole)>,
}

/// Rules for the server of one laboratory.
pub fn access_control(seats: &Seats) -> Value {
    // `**` does not match a chunk that begins with @.
    let everything = [vec!["**".to_owned(), seats.keys.every_key()], foreign(&seats.keys)].concat();
    let mut rules = Rules::default();
    rules.admit(seats, &everything);
    rules.finish()
}

/// Rules for a router between laboratories: nobody hears or says anything outside of a realm in which he has a seat.
pub fn router_access_control(labs: &[Seats]) -> Value {
    let mut rules = Rules::default();
    for seats in labs {
        rules.admit(seats, &[vec![seats.keys.every_key()], foreign(&seats.keys)].concat());
    }
    rules.finish()
}

/// What clients of another version of the wire ask; the server only tells them so.
fn foreign(keys: &KeySpace) -> Vec<String> {
    keys.every_foreign_rpc().into_iter().map(|(_, key)| key).collect()
}

/// Rules, and which of them hold for whom.
#[derive(Default)]
struct Rules {
    rules: Vec<Value>,
    allowed: BTreeMap<String, Vec<String>>,
}

impl Rules {
    fn admit(&mut self, seats: &Seats, everything: &[String]) {
        let keys = &seats.keys;
        let rpc = |orders: bool| -> Vec<String> {
            let verbs = Verb::ALL.into_iter().filter(|verb| verb.is_order() == orders);
            verbs.map(|verb| keys.key(&Topic::Rpc(verb))).collect()
        };
        let both = ["ingress", "egress"];
        let all = self.rule(keys, "all", &both, &EVERY_MESSAGE, everything.to_vec());
        let hear = self.rule(keys, "hear", &["egress"], &EVERY_MESSAGE, everything.to_vec());
        let watch = self.rule(keys, "watch", &["ingress"], &WATCHING, everything.to_vec());
        let asked = [rpc(false), vec![keys.every_keyframe()], foreign(keys)].concat();
        let ask = self.rule(keys, "ask", &["ingress"], &["query"], asked);
        let order = self.rule(keys, "order", &["ingress"], &["query"], rpc(true));
        for name in &seats.trusted {
            self.allow(name, [all.clone()]);
        }
        for (client, role) in &seats.clients {
            let id = client.as_str();
            let tokens = keys.tokens_of(client);
            let be = self.rule(keys, &format!("be-{id}"), &["ingress"], &["liveliness_token"], tokens);
            self.allow(id, [hear.clone(), watch.clone(), ask.clone(), be]);
            if role.touches() {
                let tools = keys.tools_of(client);
                let touch = self.rule(keys, &format!("touch-{id}"), &["ingress"], &["put"], tools);
                self.allow(id, [touch]);
            }
            if role.orders() {
                self.allow(id, [order.clone()]);
            }
        }
    }

    /// Adds a rule; its id.
    fn rule(
        &mut self,
        keys: &KeySpace,
        name: &str,
        flows: &[&str],
        messages: &[&str],
        on: Vec<String>,
    ) -> String {
        let id = format!("{}{name}", keys.every_key().trim_end_matches("**"));
        let rule =
            json!({ "id": id, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": on });
        self.rules.push(rule);
        id
    }

    fn allow<const N: usize>(&mut self, subject: &str, rules: [String; N]) {
        self.allowed.entry(subject.to_owned()).or_default().extend(rules);
    }

    fn finish(self) -> Value {
        let subjects: Vec<Value> =
            self.allowed.keys().map(|name| json!({ "id": name, "cert_common_names": [name] })).collect();
        let policies: Vec<Value> =
            self.allowed.iter().map(|(name, rules)| json!({ "rules": rules, "subjects": [name] })).collect();
        json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": self.rules,
            "subjects": subjects,
            "policies": policies,
        })
    }
}
