//! A server that changes to another scene: clients stay connected and see the new one.

use scindo_client::{Link, LinkConfig, LinkError, Role};
use scindo_tests::{PATIENCE, Running, free_pair};

/// Waits until the server runs the scene that is listed as `name`; its bodies, and how many scenes ran before.
async fn runs(link: &Link, name: &str) -> (Vec<String>, u32) {
    let seen = async {
        loop {
            match link.info().await {
                Ok(info) if info.scene == name => {
                    return (info.bodies.into_iter().map(|body| body.id).collect(), info.scene_seq);
                }
                // It is gone for a moment. Asking without a pause meets every moment of the change.
                Ok(_) | Err(LinkError::NoServer { .. } | LinkError::Timeout { .. }) => {}
                Err(error) => panic!("{error}"),
            }
        }
    };
    tokio::time::timeout(PATIENCE, seen).await.expect("the scene runs")
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_choose_another_scene_and_stay_connected() {
    let endpoint = format!("tcp/127.0.0.1:{}", free_pair());
    let viewer = format!("127.0.0.1:{}", free_pair());
    let arguments = ["demo", "kidney", "--listen", &endpoint, "--viewer", &viewer];
    let mut server = Running::start("scindo", &arguments).expect("starts");
    let config = LinkConfig::new(Role::Viewer, "page").with_connect([endpoint]);
    let link = Link::connect(LinkConfig { timeout: PATIENCE, ..config }).await.expect("the server answers");

    assert_eq!(runs(&link, "kidney").await, (vec!["kidney".to_owned()], 0));
    let names: Vec<String> =
        link.scenes().await.expect("listed").scenes.into_iter().map(|s| s.name).collect();
    let listed = scindo_tests::run("scindo", &["demo", "--list"]).expect("lists").stdout;
    let listed = String::from_utf8_lossy(&listed);
    let listed: Vec<&str> = listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, listed, "the page's menu has the scenes of `demo --list`");
    let unknown = link.load("tandem").await.expect_err("no such scene");
    assert!(matches!(&unknown, LinkError::Refused { code, .. } if code == "unknown-scene"), "{unknown}");

    let before = link.presence().borrow().generation;
    link.load("tendon").await.expect("accepted");
    assert_eq!(runs(&link, "tendon").await, (vec!["tendon".to_owned()], 1));
    assert!(link.presence().borrow().generation > before, "viewers are told that another scene runs");
    let mut mirror = link.mirror("tendon").await.expect("mirrors");
    let surface = tokio::time::timeout(PATIENCE, mirror.next()).await.expect("in time").expect("a surface");
    assert!(surface.topology.triangle_count > 100);
    // The choice is as good as the first, and so is the way back.
    link.load("kidney").await.expect("accepted");
    assert_eq!(runs(&link, "kidney").await, (vec!["kidney".to_owned()], 2));
    assert!(server.0.try_wait().expect("asked").is_none(), "the server still runs");
}
