//! Relay between a hub and browsers, over real sockets on port 0.
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use prost::Message as _;
use scindo_proto::messages::viewer_down::Message as Down;
use scindo_proto::messages::viewer_up::Message as FromPage;
use scindo_proto::messages::{
    Forces, Pose, Stats, SurfaceField, SurfaceFrame, SurfaceTopology, ToolSample, Vec3, ViewerDown,
    ViewerFrameAck, ViewerName, ViewerPerson, ViewerPing, ViewerUp, ViewerWatch,
};
use scindo_tests::PATIENCE;
use scindo_view::hub::{Hub, Up};
use scindo_view::{WebConfig, WebServer, page_is_built};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{self, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

type Browser = WebSocketStream<MaybeTlsStream<TcpStream>>;

async fn start(config: WebConfig) -> (SocketAddr, Arc<Hub>, mpsc::Receiver<Up>) {
    let (hub, up) = Hub::new("view-test");
    let listen = SocketAddr::from(([127, 0, 0, 1], 0));
    let web =
        WebServer::bind(WebConfig { listen, ..config }, Arc::clone(&hub), "a test".into()).await.unwrap();
    let address = web.address();
    tokio::spawn(web.run());
    (address, hub, up)
}

async fn open(address: SocketAddr, origin: &str) -> Result<Browser, tungstenite::Error> {
    let mut request = format!("ws://{address}/ws").into_client_request().unwrap();
    request.headers_mut().insert("origin", origin.parse().unwrap());
    connect_async(request).await.map(|(stream, _)| stream)
}

async fn join(address: SocketAddr) -> Browser {
    open(address, &format!("http://{address}")).await.unwrap()
}

/// The next message that is not about who is there: that comes whenever somebody joins or leaves.
async fn next(browser: &mut Browser) -> Option<Down> {
    loop {
        match any(browser).await? {
            Down::People(_) => {}
            message => return Some(message),
        }
    }
}

async fn any(browser: &mut Browser) -> Option<Down> {
    loop {
        match timeout(PATIENCE, browser.next()).await.unwrap()? {
            Ok(Message::Binary(bytes)) => return ViewerDown::decode(bytes).unwrap().message,
            Ok(Message::Close(_)) | Err(_) => return None,
            Ok(_) => {}
        }
    }
}

async fn send(browser: &mut Browser, message: FromPage) {
    let bytes = ViewerUp { message: Some(message) }.encode_to_vec();
    browser.send(Message::Binary(bytes.into())).await.unwrap();
}

fn topology(epoch: u32) -> Down {
    Down::Topology(SurfaceTopology { body_id: "liver".into(), epoch, ..Default::default() })
}

fn frame(epoch: u32, seq: u64) -> Down {
    Down::Frame(SurfaceFrame { body_id: "liver".into(), epoch, seq, ..Default::default() })
}

fn sample(x: f64) -> FromPage {
    let position = Vec3 { x, y: 0.0, z: 0.0 };
    FromPage::Tool(ToolSample {
        client_id: "somebody-else".into(),
        tool_id: "scalpel".into(),
        pose: Some(Pose { position_m: Some(position), qw: 1.0, ..Default::default() }),
        mode: 1,
        ..Default::default()
    })
}

#[tokio::test]
async fn everybody_hears_who_is_there() {
    let (address, _hub, _up) = start(WebConfig::default()).await;
    let mut first = join(address).await;
    let people = async |browser: &mut Browser| loop {
        match any(browser).await {
            Some(Down::People(people)) => break people.people,
            Some(_) => {}
            None => panic!("the link ended"),
        }
    };
    let ids = |people: &[ViewerPerson]| people.iter().map(|p| p.tool_id.clone()).collect::<Vec<_>>();
    assert_eq!(ids(&people(&mut first).await), ["view-test-mouse-1"]);
    let mut second = join(address).await;
    assert_eq!(ids(&people(&mut first).await), ["view-test-mouse-1", "view-test-mouse-2"]);
    assert_eq!(people(&mut second).await.len(), 2);
    send(&mut second, FromPage::Name(ViewerName { name: "Eva".into() })).await;
    let named = people(&mut first).await;
    assert_eq!(named[1].name, "Eva");
    drop(second);
    assert_eq!(ids(&people(&mut first).await), ["view-test-mouse-1"]);
}

#[tokio::test]
async fn a_late_joiner_gets_the_newest_of_everything_in_order() {
    let (address, hub, _up) = start(WebConfig::default()).await;
    hub.set_link(true, "here");
    hub.publish(topology(0));
    hub.publish(frame(0, 1));
    hub.publish(topology(3));
    hub.publish(frame(3, 7));
    hub.publish(frame(3, 8));
    let mut browser = join(address).await;
    assert!(
        matches!(next(&mut browser).await, Some(Down::Hello(hello)) if hello.tool_id == "view-test-mouse-1")
    );
    assert!(matches!(next(&mut browser).await, Some(Down::Link(link)) if link.connected));
    assert!(matches!(next(&mut browser).await, Some(Down::Topology(t)) if t.epoch == 3));
    assert!(matches!(next(&mut browser).await, Some(Down::Frame(f)) if f.seq == 8));
}

#[tokio::test]
async fn frames_of_the_epoch_before_are_not_shown_to_late_joiners() {
    let (address, hub, _up) = start(WebConfig::default()).await;
    hub.publish(topology(0));
    hub.publish(frame(0, 1));
    hub.publish(topology(1));
    let mut browser = join(address).await;
    next(&mut browser).await;
    assert!(matches!(next(&mut browser).await, Some(Down::Topology(t)) if t.epoch == 1));
    hub.publish(frame(1, 2));
    assert!(matches!(next(&mut browser).await, Some(Down::Frame(f)) if f.seq == 2));
}

#[tokio::test]
async fn a_browser_that_does_not_acknowledge_gets_no_backlog() {
    let (address, hub, _up) = start(WebConfig::default()).await;
    let mut browser = join(address).await;
    next(&mut browser).await;
    for seq in 0..500 {
        hub.publish(frame(0, seq));
        tokio::time::sleep(Duration::from_micros(200)).await;
    }
    let mut frames = 0;
    hub.publish(Down::Stats(Stats { seq: 1, ..Default::default() }));
    loop {
        match next(&mut browser).await {
            Some(Down::Frame(_)) => frames += 1,
            Some(Down::Stats(_)) => break,
            other => panic!("{other:?}"),
        }
    }
    assert!((1..=8).contains(&frames), "{frames}");
    send(&mut browser, FromPage::FrameAck(ViewerFrameAck { frames })).await;
    assert!(matches!(next(&mut browser).await, Some(Down::Frame(f)) if f.seq == 499), "newest wins");
}

#[tokio::test]
async fn a_browser_speaks_only_for_itself_and_its_tool_ends_with_it() {
    let (address, _hub, mut up) = start(WebConfig::default()).await;
    let mut browser = join(address).await;
    send(&mut browser, sample(f64::NAN)).await;
    send(&mut browser, sample(0.1)).await;
    let Some(Up::Tool(taken)) = up.recv().await else { panic!("a pose") };
    assert_eq!(
        (taken.client_id.as_str(), taken.tool_id.as_str()),
        ("view-test-mouse-1", "view-test-mouse-1")
    );
    assert_eq!(taken.pose.unwrap().position_m.unwrap().x, 0.1, "the one that is not finite was refused");
    drop(browser);
    let ended = timeout(PATIENCE, up.recv()).await.unwrap();
    assert!(matches!(ended, Some(Up::Release { tool_id }) if tool_id == "view-test-mouse-1"));
}

#[tokio::test]
async fn pages_of_other_origins_are_refused() {
    let (address, hub, _up) = start(WebConfig::default()).await;
    let refused = open(address, "http://elsewhere.example").await;
    assert!(matches!(refused, Err(tungstenite::Error::Http(answer)) if answer.status() == 403));
    assert_eq!(hub.browsers(), 0);
    let (address, _hub, _up) =
        start(WebConfig { allow_origins: vec!["http://elsewhere.example".into()], ..WebConfig::default() })
            .await;
    assert!(open(address, "http://elsewhere.example").await.is_ok());
}

#[tokio::test]
async fn browsers_are_counted_and_limited() {
    let (address, hub, _up) = start(WebConfig { max_browsers: 1, ..WebConfig::default() }).await;
    let mut first = join(address).await;
    next(&mut first).await;
    assert!(hub.watched().borrow().scene);
    assert!(open(address, &format!("http://{address}")).await.is_err());
    send(&mut first, FromPage::Ping(ViewerPing { page_time_ms: 5.0 })).await;
    assert!(
        matches!(next(&mut first).await, Some(Down::Pong(p)) if p.browsers == 1 && p.page_time_ms == 5.0)
    );
    drop(first);
    let mut watched = hub.watched();
    timeout(PATIENCE, watched.wait_for(|watched| !watched.scene)).await.unwrap().unwrap();
}

/// Stress, measures and forces go to the pages that asked, and are asked of the server only while one does.
#[tokio::test]
async fn fields_go_only_to_pages_that_ask() {
    let (address, hub, _up) = start(WebConfig::default()).await;
    let (mut asks, mut does_not) = (join(address).await, join(address).await);
    next(&mut asks).await;
    next(&mut does_not).await;
    let mut watched = hub.watched();
    assert!(!watched.borrow().stress && !watched.borrow().measures && !watched.borrow().forces);
    send(&mut asks, FromPage::Watch(ViewerWatch { stress: true, measures: true, forces: true })).await;
    timeout(PATIENCE, watched.wait_for(|watched| watched.stress && watched.measures && watched.forces))
        .await
        .unwrap()
        .unwrap();
    hub.publish(Down::Field(SurfaceField { body_id: "liver".into(), ..Default::default() }));
    hub.publish(Down::Forces(Forces { seq: 3, ..Default::default() }));
    hub.publish(Down::Stats(Stats { seq: 7, ..Default::default() }));
    let all = [next(&mut asks).await, next(&mut asks).await, next(&mut asks).await];
    assert!(all.iter().any(|message| matches!(message, Some(Down::Field(_)))), "{all:?}");
    assert!(all.iter().any(|message| matches!(message, Some(Down::Forces(_)))), "{all:?}");
    assert!(matches!(next(&mut does_not).await, Some(Down::Stats(stats)) if stats.seq == 7));
    // One that asks later is sent what is there.
    send(&mut does_not, FromPage::Watch(ViewerWatch { stress: true, measures: false, forces: false })).await;
    assert!(matches!(next(&mut does_not).await, Some(Down::Field(_))));
    send(&mut does_not, FromPage::Watch(ViewerWatch::default())).await;
    drop(asks);
    timeout(PATIENCE, watched.wait_for(|watched| !watched.stress && !watched.measures && !watched.forces))
        .await
        .unwrap()
        .unwrap();
}

#[tokio::test]
async fn a_page_that_sends_too_much_or_nonsense_is_sent_away() {
    let (address, _hub, _up) = start(WebConfig::default()).await;
    let mut large = join(address).await;
    next(&mut large).await;
    let _ = large.send(Message::Binary(vec![0_u8; 300_000].into())).await;
    assert!(next(&mut large).await.is_none());
    let mut nonsense = join(address).await;
    next(&mut nonsense).await;
    for _ in 0..40 {
        if nonsense.send(Message::Binary(vec![0xff_u8; 12].into())).await.is_err() {
            break;
        }
    }
    assert!(next(&mut nonsense).await.is_none());
}

#[tokio::test]
async fn a_read_only_viewer_passes_nothing_on() {
    let (address, _hub, mut up) = start(WebConfig { read_only: true, ..WebConfig::default() }).await;
    let mut browser = join(address).await;
    send(&mut browser, sample(0.1)).await;
    send(&mut browser, FromPage::Ping(ViewerPing::default())).await;
    next(&mut browser).await;
    assert!(matches!(next(&mut browser).await, Some(Down::Pong(_))));
    assert!(up.try_recv().is_err());
}

async fn get(address: SocketAddr, path: &str) -> String {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn the_page_is_served_or_says_what_to_install() {
    let (address, _hub, _up) = start(WebConfig::default()).await;
    let page = get(address, "/").await;
    assert!(page.starts_with("HTTP/1.1 200"), "{page}");
    if page_is_built() {
        assert!(page.contains("viewer.js"));
        assert!(get(address, "/viewer.js").await.contains("text/javascript"));
    } else {
        assert!(page.contains("cargo command again"), "{page}");
    }
    assert!(get(address, "/healthz").await.contains("\"connected\":false"));
    assert!(get(address, "/..%2fCargo.toml").await.starts_with("HTTP/1.1 404"));
}
