//! The rules of the inbox, one by one.

use super::cut_log::{MAX_ANSWERS, MAX_WAITING_CUTS};
use super::early::PATIENCE;
use super::owners::{MAX_CLIENTS, NO_TOKEN};
use super::*;
use scindo_proto::messages::{BladeSegment, Pose, ToolShape, Vec3};
use scindo_world::inputs::MAX_TOOLS;

fn inbox() -> Inbox {
    Inbox::new([Arc::from("beam")], [Arc::from("scalpel")])
}

/// The time at which every test begins.
fn start() -> Instant {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    *START.get_or_init(Instant::now)
}

fn figures(inbox: &Inbox) -> Figures {
    let mut figures = Figures::default();
    inbox.figures_into(&mut figures);
    figures
}

/// An inbox with clients `a` and `b` present.
fn visited() -> Inbox {
    let mut inbox = inbox();
    inbox.client_came("a", start());
    inbox.client_came("b", start());
    inbox
}

const WITH: Answering<'static> = Answering { step: 3, epochs: &[], code: "cut-failed", hint: "" };

fn sample(client: &str, tool: &str, seq: u64) -> ToolSample {
    ToolSample {
        seq,
        client_id: client.into(),
        tool_id: tool.into(),
        pose: Some(Pose { position_m: Some(Vec3::default()), qw: 1.0, ..Pose::default() }),
        ..ToolSample::default()
    }
}

fn of<'a>(client: &'a str, tool: &'a str) -> Sender<'a> {
    Sender { client, tool }
}

/// Delivers `sample` under the key of its own client and tool.
fn pose(inbox: &mut Inbox, sample: &ToolSample, now: Instant) -> Result<Option<Change>, Refusal> {
    inbox.pose(of(&sample.client_id, &sample.tool_id), sample, now)
}

/// Delivers `command` under the key of its own client and tool.
fn cut(inbox: &mut Inbox, command: &CutCommand) -> Cut {
    inbox.cut(of(&command.client_id, &command.tool_id), command)
}

fn command(client: &str, seq: u64) -> CutCommand {
    CutCommand {
        client_id: client.into(),
        tool_id: "scalpel".into(),
        seq,
        body_id: "beam".into(),
        sweep: vec![BladeSegment::default(); 2],
        ..CutCommand::default()
    }
}

#[test]
fn a_tool_belongs_to_the_first_living_client_until_its_token_goes() {
    let mut inbox = inbox();
    inbox.client_came("a", start());
    inbox.client_came("b", start());
    assert!(matches!(pose(&mut inbox, &sample("a", "scalpel", 1), start()), Ok(Some(Change::Taken { .. }))));
    assert_eq!(pose(&mut inbox, &sample("b", "scalpel", 1), start()).unwrap_err().code, "not-owner");
    assert_eq!(pose(&mut inbox, &sample("a", "scalpel", 1), start()).unwrap_err().code, "stale-sequence");
    assert_eq!(pose(&mut inbox, &sample("a", "scalpel", 2), start()), Ok(None));
    assert!(inbox.client_went("b", start()).is_empty());
    assert_eq!(inbox.client_went("a", start()).len(), 1);
    assert!(!inbox.anybody_holds());
    inbox.client_came("b", start());
    assert!(pose(&mut inbox, &sample("b", "scalpel", 1), start()).is_ok());
    assert_eq!(inbox.refused()["not-owner"], 1);
}

#[test]
fn a_pose_that_overtook_the_token_counts_when_the_token_comes() {
    let mut inbox = inbox();
    for seq in 1..4 {
        assert_eq!(pose(&mut inbox, &sample("a", "scalpel", seq), start()), Ok(None));
    }
    assert!(!inbox.anybody_holds());
    let taken = Change::Taken { tool: "scalpel".into(), owner: "a".into() };
    assert_eq!(inbox.client_came("a", start()), [taken]);
    assert_eq!(inbox.held().next().unwrap().seq, 3);
    assert_eq!(inbox.client_came("a", start()), []);
    assert_eq!(inbox.refused().len(), 0);
    let late = start() + PATIENCE;
    assert_eq!(pose(&mut inbox, &sample("b", "scalpel", 1), late), Ok(None));
    let refused = pose(&mut inbox, &sample("b", "scalpel", 2), late + PATIENCE);
    assert_eq!(refused.unwrap_err().code, "no-token");
}

#[test]
fn a_new_tool_needs_a_shape_and_there_are_as_many_as_the_world_takes() {
    let mut inbox = inbox();
    inbox.client_came("a", start());
    assert_eq!(pose(&mut inbox, &sample("a", "probe", 1), start()).unwrap_err().code, "unknown-tool");
    assert_eq!(
        inbox.pose(of("a", "probe"), &sample("a", "other", 1), start()).unwrap_err().code,
        "wrong-key"
    );
    for i in 0..MAX_TOOLS {
        let id = format!("t{i}");
        let mut sample = sample("a", &id, 1);
        sample.shape = Some(ToolShape::default());
        assert_eq!(pose(&mut inbox, &sample, start()).is_ok(), i + 1 < MAX_TOOLS);
    }
    assert_eq!(inbox.refused()["too-many-tools"], 1);
}

#[test]
fn a_flood_of_poses_is_cut_short() {
    let mut inbox = inbox();
    inbox.client_came("a", start());
    for seq in 1..=u64::from(MAX_POSE_RATE) + 50 {
        let _ = pose(&mut inbox, &sample("a", "scalpel", seq), start());
    }
    assert_eq!(inbox.refused()["too-fast"], 50);
    assert_eq!(figures(&inbox).tools[0].poses, u64::from(MAX_POSE_RATE));
    let later = start() + std::time::Duration::from_secs(1);
    assert_eq!(pose(&mut inbox, &sample("a", "scalpel", 1_000_000), later), Ok(None));
}

#[test]
fn a_cut_is_applied_once_however_often_it_comes() {
    let mut inbox = visited();
    assert_eq!(cut(&mut inbox, &command("a", 1)), Cut::Queued);
    assert_eq!(cut(&mut inbox, &command("a", 1)), Cut::Waiting);
    let mut inputs = Inputs::default();
    inbox.take(&mut inputs);
    assert_eq!(inputs.cuts.len(), 1);
    assert_eq!(cut(&mut inbox, &command("a", 1)), Cut::Waiting);
    let outcome = CutOutcome { request: inputs.cuts[0].request, result: Ok(7) };
    let acks = inbox.finish(&[outcome], &WITH);
    assert_eq!((acks[0].outcome(), acks[0].elements_cut), (cut_ack::Outcome::Applied, 7));
    let Cut::Answer(again) = cut(&mut inbox, &command("a", 1)) else { panic!() };
    assert_eq!((again.outcome(), again.elements_cut), (cut_ack::Outcome::Duplicate, 7));
    assert_eq!(cut(&mut inbox, &command("b", 1)), Cut::Queued);
    inbox.take(&mut inputs);
    assert_eq!(inputs.cuts.len(), 1);
    assert_eq!(figures(&inbox).cuts_applied, 1);
}

#[test]
fn forgotten_answers_are_still_duplicates() {
    let mut inbox = visited();
    for seq in 1..=MAX_ANSWERS as u64 + 10 {
        assert_eq!(cut(&mut inbox, &command("a", seq)), Cut::Queued);
        let mut inputs = Inputs::default();
        inbox.take(&mut inputs);
        inbox.finish(&[CutOutcome { request: inputs.cuts[0].request, result: Ok(0) }], &WITH);
    }
    let Cut::Answer(old) = cut(&mut inbox, &command("a", 1)) else { panic!() };
    assert_eq!(old.outcome(), cut_ack::Outcome::Duplicate);
}

#[test]
fn refused_cuts_say_why_and_are_counted() {
    let mut inbox = visited();
    let mut foreign = command("a", 5000);
    foreign.body_id = "liver".into();
    let Cut::Answer(ack) = cut(&mut inbox, &foreign) else { panic!() };
    assert_eq!(ack.outcome(), cut_ack::Outcome::Refused);
    assert_eq!(ack.error.unwrap().code, "unknown-body");
    for seq in 1..=MAX_WAITING_CUTS as u64 {
        assert_eq!(cut(&mut inbox, &command("a", seq)), Cut::Queued);
    }
    let Cut::Answer(ack) = cut(&mut inbox, &command("a", 999)) else { panic!() };
    assert_eq!(ack.error.unwrap().code, "queue-full");
    pose(&mut inbox, &sample("b", "scalpel", 1), start()).unwrap();
    let Cut::Answer(ack) = cut(&mut inbox, &command("a", 1000)) else { panic!() };
    assert_eq!(ack.error.unwrap().code, "not-owner");
    assert_eq!(inbox.refused().values().sum::<u64>(), 3);
}

#[test]
fn a_cut_of_a_client_without_a_token_is_refused() {
    let mut inbox = inbox();
    let Cut::Answer(ack) = cut(&mut inbox, &command("a", 1)) else { panic!() };
    assert_eq!(ack.error.unwrap().code, "no-token");
    inbox.client_came("a", start());
    assert_eq!(cut(&mut inbox, &command("a", 1)), Cut::Queued);
}

#[test]
fn cuts_that_a_step_has_taken_still_count_as_waiting() {
    let mut inbox = visited();
    let mut inputs = Inputs::default();
    for seq in 1..=MAX_WAITING_CUTS as u64 {
        assert_eq!(cut(&mut inbox, &command("a", seq)), Cut::Queued);
        inbox.take(&mut inputs);
    }
    let Cut::Answer(ack) = cut(&mut inbox, &command("a", 999)) else { panic!() };
    assert_eq!(ack.error.unwrap().code, "queue-full");
}

#[test]
fn what_is_discarded_is_answered_once_and_not_applied_again() {
    let mut inbox = visited();
    cut(&mut inbox, &command("a", 1));
    cut(&mut inbox, &command("b", 1));
    let with = Answering { code: "cut-discarded", ..WITH };
    let answers = inbox.discard("the scene was reset", &with);
    assert_eq!(answers.len(), 2);
    assert!(answers.iter().all(|ack| ack.outcome() == cut_ack::Outcome::Refused));
    assert_eq!(inbox.discard("the scene was reset", &with), []);
    assert!(matches!(cut(&mut inbox, &command("a", 1)), Cut::Answer(ack) if ack == answers[0]));
    let mut inputs = Inputs::default();
    inbox.take(&mut inputs);
    assert!(inputs.cuts.is_empty());
}

#[test]
fn a_late_pose_of_the_old_hand_does_not_keep_the_new_one_from_the_tool() {
    let mouse = |seq, client_time_ns| ToolSample { client_time_ns, ..sample("a", "scalpel", seq) };
    let mut inbox = inbox();
    inbox.client_came("a", start());
    pose(&mut inbox, &mouse(141, 1_000), start()).unwrap();
    inbox.client_went("a", start());
    // The last pose of the old hand arrives after its token went. It does not wait for the next token.
    assert_eq!(pose(&mut inbox, &mouse(142, 1_001), start()).unwrap_err().code, "let-go");
    assert_eq!(inbox.client_came("a", start()), []);
    // Even if it came later still, the first pose of the new hand is newer by its clock.
    pose(&mut inbox, &mouse(143, 1_002), start()).unwrap();
    assert_eq!(pose(&mut inbox, &mouse(1, 2_000), start()), Ok(None));
    assert_eq!(pose(&mut inbox, &mouse(2, 2_001), start()), Ok(None));
    assert_eq!(pose(&mut inbox, &mouse(1, 2_000), start()).unwrap_err().code, "stale-sequence");
    assert_eq!(inbox.held().next().unwrap().seq, 2);
}

#[test]
fn a_client_that_comes_back_goes_on_with_its_numbers() {
    let mut inbox = inbox();
    inbox.client_came("a", start());
    pose(&mut inbox, &sample("a", "scalpel", 7), start()).unwrap();
    inbox.client_went("a", start());
    inbox.client_came("a", start());
    assert!(matches!(pose(&mut inbox, &sample("a", "scalpel", 8), start()), Ok(Some(_))));
}

/// A step gets every pose of a blade that cuts since the last one, and of other tools the newest alone.
#[test]
fn a_step_gets_all_places_of_a_cutting_blade() {
    use scindo_proto::messages::tool_sample::Mode;
    let mut inbox = visited();
    let send = |inbox: &mut Inbox, seq: u64, mode: Mode| {
        let mut sample = sample("a", "scalpel", seq);
        sample.pose = Some(Pose {
            position_m: Some(Vec3 { x: seq as f64, y: 0.0, z: 0.0 }),
            qw: 1.0,
            ..Pose::default()
        });
        sample.mode = mode.into();
        pose(inbox, &sample, start()).unwrap();
    };
    let mut inputs = Inputs::default();
    let mut take = |inbox: &mut Inbox| {
        inbox.take(&mut inputs);
        let tool = &inputs.tools[0];
        let places = tool.passed.iter().chain([&tool.pose]);
        places.map(|pose| pose.translation.vector.x).collect::<Vec<_>>()
    };
    (1..=3).for_each(|seq| send(&mut inbox, seq, Mode::Cut));
    assert_eq!(take(&mut inbox), [1.0, 2.0, 3.0]);
    assert_eq!(take(&mut inbox), [3.0], "nothing came");
    (4..=5).for_each(|seq| send(&mut inbox, seq, Mode::Cut));
    assert_eq!(take(&mut inbox), [4.0, 5.0]);
    (6..=8).for_each(|seq| send(&mut inbox, seq, Mode::Touch));
    assert_eq!(take(&mut inbox), [8.0]);
    (9..=200).for_each(|seq| send(&mut inbox, seq, Mode::Cut));
    let places = take(&mut inbox);
    assert!(places.len() <= scindo_world::inputs::MAX_PASSED + 1 && places.last() == Some(&200.0), "bounded");
}

#[test]
fn nobody_moves_releases_or_cuts_with_the_tool_of_another() {
    let mut inbox = visited();
    pose(&mut inbox, &sample("a", "scalpel", 1), start()).unwrap();
    // Client b may publish to its own keys alone, whatever the content of its messages says.
    let forged = inbox.pose(of("b", "scalpel"), &sample("a", "scalpel", 2), start());
    assert_eq!(forged.unwrap_err().code, "wrong-key");
    assert_eq!(inbox.held().next().unwrap().seq, 1);
    assert_eq!(pose(&mut inbox, &sample("b", "scalpel", 1), start()).unwrap_err().code, "not-owner");
    let Cut::Answer(ack) = cut(&mut inbox, &command("b", 7)) else { panic!() };
    assert_eq!(ack.error.unwrap().code, "not-owner");
    // A forged cut has no answer. Client a, who cuts with the same number, is not disturbed.
    let Cut::Stray(refusal) = inbox.cut(of("b", "scalpel"), &command("a", 7)) else { panic!() };
    assert_eq!(refusal.code, "wrong-key");
    assert_eq!(cut(&mut inbox, &command("a", 7)), Cut::Queued);
    let device = DeviceCapability {
        client_id: "a".into(),
        tool_id: "scalpel".into(),
        max_force_n: 1e3,
        ..DeviceCapability::default()
    };
    assert_eq!(inbox.capability(of("b", "scalpel"), device.clone()).unwrap_err().code, "wrong-key");
    assert!(inbox.capability_of("scalpel").is_none());
    inbox.capability(of("a", "scalpel"), device).unwrap();
    assert!(inbox.capability_of("scalpel").is_some());
    assert_eq!(inbox.refused()["wrong-key"], 3);
    inbox.client_went("b", start());
    assert!(inbox.anybody_holds());
}

#[test]
fn a_refusal_is_final_although_the_reason_may_have_gone() {
    let mut inbox = visited();
    pose(&mut inbox, &sample("a", "scalpel", 1), start()).unwrap();
    let Cut::Answer(refused) = cut(&mut inbox, &command("b", 7)) else { panic!() };
    assert_eq!(refused.error.clone().unwrap().code, "not-owner");
    // Client a leaves. A copy of the cut that was under way arrives now.
    inbox.client_went("a", start());
    assert_eq!(cut(&mut inbox, &command("b", 7)), Cut::Answer(refused));
    assert_eq!(cut(&mut inbox, &command("b", 8)), Cut::Queued);
}

#[test]
fn one_client_does_not_take_the_places_of_others() {
    let mut inbox = visited();
    let with = |client: &str, tool: usize| CutCommand { tool_id: format!("t{tool}"), ..command(client, 1) };
    let codes: Vec<Option<String>> = (0..20)
        .map(|tool| match cut(&mut inbox, &with("a", tool)) {
            Cut::Queued => None,
            Cut::Answer(ack) => Some(ack.error.unwrap().code),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(codes.iter().filter(|code| code.is_none()).count(), 16);
    assert!(codes.into_iter().flatten().all(|code| code == "too-many-tools"));
    assert_eq!(cut(&mut inbox, &with("b", 1)), Cut::Queued);
}

#[test]
fn invented_clients_shut_no_newcomer_out_and_nobody_who_works() {
    let mut inbox = visited();
    assert!(pose(&mut inbox, &sample("a", "scalpel", 1), start()).is_ok());
    for k in 0..2 * MAX_CLIENTS {
        inbox.client_came(&format!("invented-{k}"), start());
    }
    assert_eq!(figures(&inbox).client_count, MAX_CLIENTS);
    assert_eq!(pose(&mut inbox, &sample("a", "scalpel", 2), start()), Ok(None));
    // A newcomer works at once, and stays when more come.
    inbox.client_came("new", start());
    let theirs = ToolSample { shape: Some(ToolShape::default()), ..sample("new", "own", 1) };
    assert!(matches!(pose(&mut inbox, &theirs, start()), Ok(Some(Change::Taken { .. }))));
    for k in 0..MAX_CLIENTS {
        inbox.client_came(&format!("more-{k}"), start());
    }
    assert!(pose(&mut inbox, &ToolSample { seq: 2, ..theirs }, start()).is_ok());
    // Who has done nothing was forgotten, and comes back with its token.
    let theirs = CutCommand { tool_id: "mouse".into(), ..command("b", 1) };
    let Cut::Answer(ack) = cut(&mut inbox, &theirs) else { panic!() };
    assert_eq!(ack.error.unwrap().code, NO_TOKEN);
    inbox.client_came("b", start());
    assert_eq!(cut(&mut inbox, &theirs), Cut::Queued);
    // Tokens that go are those of clients that are still known, or of nobody.
    for k in 0..2 * MAX_CLIENTS {
        inbox.client_went(&format!("invented-{k}"), start());
        inbox.client_went(&format!("more-{k}"), start());
    }
    assert_eq!(figures(&inbox).client_count, 3);
}
