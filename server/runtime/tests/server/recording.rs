//! Recordings: a session with cuts, orders and tools is computed again to the bit; differences are found.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use nalgebra::{Isometry3, Vector3};
use prost::Message;
use scindo::record::on_demand::RecordFolder;
use scindo::record::reader::{Recorded, Recording};
use scindo::record::recorder::RecordSettings;
use scindo::record::replay::{Replay, newest};
use scindo::record::writer::{Item, TOPICS, WriterThread};
use scindo::sim::engine::Engine;
use scindo_tests::scene::{WORLD, block, held};
use scindo_world::inputs::{CutRequest, Inputs, ToolInput, ToolMode, ToolShape};
use scindo_world::scene::Scene;
use scindo_world::simulation::Simulation;

fn scene() -> Scene {
    let keys = "rayleigh = { stiffness_s = 0.02 }\n".to_owned() + &held("z");
    let block = block("block", [[0.0; 3], [0.2, 0.1, 0.1]], [14, 7, 7], &keys);
    Scene::from_toml(&[WORLD, "effects = { governor = true }\n", &block].concat()).unwrap()
}

/// Steps of the session: a client cuts in every second one.
const SESSION: u64 = 400;

fn inputs(step: u64) -> Inputs {
    let phase = step as f64 * 0.05;
    let tip = Vector3::new(0.1 + 0.05 * phase.sin(), 0.05, 0.103 - 0.006 * (0.3 * phase).sin());
    let tool = ToolInput {
        mode: if step % 60 < 30 { ToolMode::Touch } else { ToolMode::Grab },
        shape: Some(ToolShape::Sphere { radius_m: 0.01 }),
        seq: step,
        ..ToolInput::new("finger", "hand", Isometry3::new(tip, Vector3::new(0.1 * phase, 0.2, 0.3)))
    };
    let n = (step / 2) as f64;
    let (x, y) = (0.2 * (n * 0.618_034).fract(), 0.1 * (n * 0.754_878).fract());
    let along = if step.is_multiple_of(4) { Vector3::x() } else { Vector3::y() };
    let edge = |s: f64| {
        let place = Vector3::new(x, y, 0.0) + along * s;
        [place + Vector3::z() * 0.06, place + Vector3::z() * 0.12]
    };
    let cut = CutRequest {
        request: step,
        tool: Arc::from("knife"),
        body: None,
        segments: vec![edge(-0.008), edge(0.0), edge(0.008)],
    };
    let cuts = if step.is_multiple_of(2) { vec![cut] } else { Vec::new() };
    Inputs { tools: vec![tool], cuts, ..Inputs::default() }
}

/// Records a session with every kind of order into `file`; the cuts that were made.
fn record(file: &Path, steps: u64) -> u64 {
    let scene = scene();
    let simulation = Simulation::new(&scene, Path::new("")).unwrap();
    let mut engine = Engine::new(simulation, None).unwrap();
    let checkpoint = Duration::from_millis(50);
    let file = file.to_owned();
    engine.record(RecordSettings { file, checkpoint, surfaces: true, patient: true, threads: 1 }).unwrap();
    let mut cuts = 0;
    for step in 0..steps {
        match step {
            20 => engine.set("body.block.young_pa", "3e4").unwrap(),
            40 => drop(engine.snapshot("before").unwrap()),
            60 => drop(engine.undo().unwrap()),
            80 => {
                cuts += engine.simulation().cuts_applied();
                engine.discard_cuts("a restore");
                engine.restore("before").unwrap();
                cuts -= engine.simulation().cuts_applied();
            }
            90 => {
                cuts += engine.simulation().cuts_applied();
                engine.discard_cuts("a reset");
                engine.reset().unwrap();
                cuts -= engine.simulation().cuts_applied();
            }
            _ => {}
        }
        engine.step(&inputs(step));
        // Late steps, as a slow machine would make them: the governor gives up accuracy, then takes it back.
        engine.govern(Duration::from_millis(if step % 100 < 30 { 15 } else { 2 }));
    }
    cuts += engine.simulation().cuts_applied();
    engine.finish("done").unwrap();
    assert_eq!(engine.take_recording_failure(), None);
    cuts
}

fn replayed(file: &Path, threads: usize, from_s: Option<f64>) -> scindo::record::replay::Replayed {
    let mut replay = Replay::open(file, threads, from_s).unwrap();
    while replay.step().unwrap().is_some() {}
    replay.found().clone()
}

#[test]
fn a_session_with_a_hundred_cuts_is_the_same_on_one_two_and_three_threads() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("session.mcap");
    let cuts = record(&file, SESSION);
    assert!(cuts >= 100, "only {cuts} cuts were made");
    for threads in [1, 2, 3] {
        let found = replayed(&file, threads, None);
        assert_eq!((found.steps, found.compared, found.from), (SESSION, SESSION, 0), "{found:?}");
        assert_eq!((&found.first_difference, &found.truncated), (&None, &None), "{threads} threads");
    }
    for from_s in [0.3, 0.7, 1.7, 3.5] {
        let found = replayed(&file, 2, Some(from_s));
        assert_eq!(found.first_difference, None, "from {from_s} s");
        // A busy machine writes few checkpoints, but always one where a state was restored.
        let restored = if from_s > 1.0 { 80 } else { 0 };
        assert!(found.from >= restored && found.from <= (100.0 * from_s) as u64, "{found:?}");
        assert_eq!(found.from + found.steps, SESSION);
    }
    let bytes = fs::metadata(&file).unwrap().len();
    println!("{cuts} cuts, {SESSION} steps: {bytes} bytes");
    // Somebody would overwrite a recording by mistake.
    let settings = RecordSettings {
        file,
        checkpoint: Duration::from_secs(1),
        surfaces: false,
        patient: true,
        threads: 1,
    };
    let simulation = Simulation::new(&scene(), Path::new("")).unwrap();
    let refused = Engine::new(simulation, None).unwrap().record(settings).unwrap_err().to_string();
    assert!(refused.contains("must not exist yet"), "{refused}");
}

#[test]
fn an_operator_records_a_part_and_takes_the_state_away() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    let begin = || Engine::new(Simulation::new(&scene, Path::new("")).unwrap(), None).unwrap();
    let mut engine = begin();
    assert!(engine.begin_recording().unwrap_err().contains("without a folder"));
    let settings = RecordSettings {
        file: PathBuf::new(),
        checkpoint: Duration::from_millis(50),
        surfaces: false,
        patient: true,
        threads: 1,
    };
    engine.let_record(RecordFolder { folder: folder.path().to_owned(), settings });
    assert!(engine.end_recording().unwrap_err().contains("nothing is being recorded"));
    (0..30).for_each(|step| engine.step(&inputs(step)));
    let file = engine.begin_recording().unwrap();
    assert!(engine.begin_recording().unwrap_err().contains(&file));
    (30..70).for_each(|step| engine.step(&inputs(step)));
    assert!(engine.recording().unwrap().bytes > 0);
    let state = engine.state_messages().unwrap().file().unwrap();
    assert_eq!(engine.end_recording().unwrap(), file);
    assert_eq!(engine.recording(), None);
    // Another one within the same second has a name of its own.
    let other = engine.begin_recording().unwrap();
    assert_ne!(other, file);
    (70..80).for_each(|step| engine.step(&inputs(step)));
    engine.finish("done").unwrap();
    for (file, steps) in [(&file, 40), (&other, 10)] {
        let found = replayed(&folder.path().join(file), 2, None);
        assert_eq!((found.steps, found.compared, found.jumps.len()), (steps, steps, 1), "{found:?}");
        assert_eq!((&found.first_difference, &found.truncated), (&None, &None));
    }
    let taken = folder.path().join("state.mcap");
    fs::write(&taken, &state).unwrap();
    let (from, step, state) = newest(&taken).unwrap();
    let mut simulation = Simulation::new(&from, Path::new("")).unwrap();
    simulation.restore(&state).unwrap();
    assert_eq!((step, simulation.steps()), (70, 70));
    (70..80).for_each(|step| {
        simulation.step(&inputs(step));
    });
    assert_eq!(simulation.state_hash(), engine.simulation().state_hash());
    let mut replay = Replay::open(&taken, 1, None).unwrap();
    assert_eq!(replay.step().unwrap(), None);
    assert_eq!(replay.simulation().steps(), 70);
}

#[test]
fn a_step_that_differs_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (file, other) = (folder.path().join("true.mcap"), folder.path().join("false.mcap"));
    record(&file, 30);
    // The same recording with one bit of the hash of step 17 turned.
    let mut writer = WriterThread::begin(&other).unwrap();
    let mut recording = Recording::open(&file).unwrap();
    let mut unix_ns = 0;
    while let Some(message) = recording.next_message().unwrap() {
        let (topic, bytes) = match message {
            Recorded::Scene(scene) => (0, scene.encode_to_vec()),
            Recorded::Step(mut step) => {
                if step.number == 17 {
                    let mut hash = step.hash.to_vec();
                    hash[3] ^= 4;
                    step.hash = hash.into();
                }
                (1, step.encode_to_vec())
            }
            Recorded::Order(order) => (2, order.encode_to_vec()),
            Recorded::Checkpoint(checkpoint) => (3, checkpoint.encode_to_vec()),
            Recorded::Event(_) | Recorded::Forces(_) => continue,
        };
        unix_ns += 1;
        writer.send(Item { topic, unix_ns, bytes }, true).unwrap();
    }
    writer.end().unwrap();
    assert_eq!(replayed(&file, 1, None).first_difference, None);
    let difference = replayed(&other, 1, None).first_difference.unwrap();
    assert_eq!((difference.number, difference.step), (17, 17));
    assert_ne!(difference.recorded, difference.found);
}

/// A record of an MCAP file.
fn mcap_record(kind: u8, content: &[u8]) -> Vec<u8> {
    [&[kind], &(content.len() as u64).to_le_bytes()[..], content].concat()
}

/// A chunk that is not packed, and says that its content is `size` bytes long.
fn loose_chunk(content: &[u8], size: u64) -> Vec<u8> {
    let head = [&[0; 16], &size.to_le_bytes()[..], &[0; 8], &(content.len() as u64).to_le_bytes()].concat();
    mcap_record(6, &[&head, content].concat())
}

#[test]
fn records_that_break_the_rules_end_the_reading() {
    let long = [&[5u8], &1000u64.to_le_bytes()[..], &[0; 22]].concat();
    let of_chunk = |chunk: Vec<u8>| (chunk, "chunk");
    // An attachment that is shorter than its own head is of no interest, and is passed over.
    let attachment = mcap_record(9, &[0; 33]);
    let broken = [
        of_chunk(loose_chunk(&long, long.len() as u64)),
        of_chunk(loose_chunk(&mcap_record(5, &[0; 30]), 3)),
        of_chunk(loose_chunk(&mcap_record(5, &[0; 30]), u64::MAX)),
        of_chunk(loose_chunk(&loose_chunk(&[], 0)[..9], 9)),
        (mcap_record(5, &[0; 3]), ""),
        (attachment, "ends in the middle"),
    ];
    for (record, words) in broken {
        let file = [mcap::MAGIC, &mcap_record(1, &[0; 8]), &record].concat();
        let mut recording = Recording::read(&file[..], "broken.mcap".to_owned());
        assert!(matches!(recording.next_message(), Ok(None)), "{record:?}");
        let why = recording.truncated().unwrap();
        assert!(why.contains(words), "{why}");
    }
}

#[test]
fn a_file_that_ends_anywhere_is_read_as_far_as_it_goes_and_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("whole.mcap");
    record(&file, 30);
    let whole = fs::read(&file).unwrap();
    let part = folder.path().join("part.mcap");
    let mut steps = Vec::new();
    for k in 0..40 {
        fs::write(&part, &whole[..whole.len() * k / 40]).unwrap();
        let Ok(mut recording) = Recording::open(&part) else { continue };
        if recording.scene().is_err() {
            continue;
        }
        let mut count = 0;
        while let Some(message) = recording.next_message().unwrap() {
            count += u64::from(matches!(message, Recorded::Step(_)));
        }
        assert!(recording.truncated().is_some(), "{k} fortieths of it");
        steps.push(count);
    }
    assert!(steps.is_sorted() && steps.last().is_some_and(|&steps| steps <= 30), "{steps:?}");
    for foreign in [&b""[..], b"no mcap at all", &whole[100..]] {
        fs::write(&part, foreign).unwrap();
        let refused = Replay::open(&part, 1, None).err().unwrap().to_string();
        assert!(refused.contains("is no recording"), "{refused}");
    }
    assert_eq!(TOPICS.len(), 8);
}
