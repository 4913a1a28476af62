//! The access control of a laboratory, for the sessions of its server.
//!
//! Clients hear everything that the server says. What comes from a client is denied unless a rule allows it: to
//! subscribe and to ask questions for everybody; to publish under its own id for those who touch; orders for those who
//! may give them. Nobody but the server publishes surfaces, contacts and reports, or answers questions.

use scindo_proto::{Chunk, KeySpace, Topic, Verb};
use serde_json::{Value, json};

use super::roles::{LabRole, SERVER};

/// Rules for `clients` by id.
pub fn access_control<'a>(keys: &KeySpace, clients: impl IntoIterator<Item = (&'a Chunk, LabRole)>) -> Value {
    // `**` does not match a chunk that begins with @.
    let everything = vec!["**".to_owned(), keys.every_key()];
    let rpc = |orders: bool| -> Vec<String> {
        let verbs = Verb::ALL.into_iter().filter(|verb| verb.is_order() == orders);
        verbs.map(|verb| keys.key(&Topic::Rpc(verb))).collect()
    };
    let asked = [rpc(false), vec![keys.every_keyframe()]].concat();
    let every_message = [
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
    let rule = |id: String, flows: &[&str], messages: &[&str], keys: Vec<String>| json!({ "id": id, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys });
    let watching = ["declare_subscriber", "liveliness_query", "declare_liveliness_subscriber"];
    let mut rules = vec![
        rule("all".into(), &["ingress", "egress"], &every_message, everything.clone()),
        rule("hear".into(), &["egress"], &every_message, everything.clone()),
        rule("watch".into(), &["ingress"], &watching, everything),
        rule("ask".into(), &["ingress"], &["query"], asked),
        rule("order".into(), &["ingress"], &["query"], rpc(true)),
    ];
    let mut subjects = vec![json!({ "id": SERVER, "cert_common_names": [SERVER] })];
    let mut policies = vec![json!({ "rules": ["all"], "subjects": [SERVER] })];
    for (client, role) in clients {
        let id = client.as_str();
        rules.push(rule(format!("be-{id}"), &["ingress"], &["liveliness_token"], keys.tokens_of(client)));
        let mut allowed = vec!["hear".to_owned(), "watch".into(), "ask".into(), format!("be-{id}")];
        if role.touches() {
            rules.push(rule(format!("touch-{id}"), &["ingress"], &["put"], keys.tools_of(client)));
            allowed.push(format!("touch-{id}"));
        }
        if role.orders() {
            allowed.push("order".into());
        }
        subjects.push(json!({ "id": id, "cert_common_names": [id] }));
        policies.push(json!({ "rules": allowed, "subjects": [id] }));
    }
    json!({
        "enabled": true,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    })
}
