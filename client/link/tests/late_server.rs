//! A link against a server that listens before it answers: made of plain zenoh.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use scindo_client::messages::SessionInfo;
use scindo_client::{Link, LinkConfig, LinkError, Role};
use scindo_proto::{KeySpace, Topic, Verb, encode, encoding};
use zenoh::Wait as _;
use zenoh::query::Query;

/// A session that listens at a port of its own choice, and a link to it.
async fn listener_and_link() -> (zenoh::Session, Link) {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"router\""),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]"),
        ("scouting/multicast/enabled", "false"),
    ] {
        config.insert_json5(key, value).unwrap();
    }
    let server = zenoh::open(config).await.unwrap();
    let endpoint = server.info().locators().await[0].to_string();
    let link = Link::connect(LinkConfig::new(Role::Haptic, "desk-1").with_connect([endpoint])).await.unwrap();
    (server, link)
}

fn info_key() -> String {
    KeySpace::new("scindo", "main").unwrap().key(&Topic::Rpc(Verb::Info))
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_still_starting_is_asked_again() {
    let (server, link) = listener_and_link().await;
    let question = tokio::spawn(async move { link.info().await });
    tokio::time::sleep(Duration::from_millis(200)).await;
    let answer = |query: Query| {
        let info = SessionInfo { scene_name: "late".to_owned(), ..SessionInfo::default() };
        query.reply(query.key_expr(), encode(&info)).encoding(encoding::<SessionInfo>()).wait().unwrap();
    };
    server.declare_queryable(info_key()).callback(answer).background().await.unwrap();
    assert_eq!(question.await.unwrap().unwrap().scene_name, "late");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nobody_there_is_said_in_the_end() {
    let (_server, link) = listener_and_link().await;
    let error = link.info().await.unwrap_err();
    assert!(matches!(&error, LinkError::NoServer { key } if *key == info_key()), "{error:?}");
}
