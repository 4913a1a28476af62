//! The simulation thread: orders, inputs, step, report, snapshots, pace.

pub mod engine;

pub mod snapshots;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender};
use scindo_proto::messages::{BodyEpoch, RecordingStats, RpcReply};
use scindo_world::inputs::{Inputs, Wants};
use scindo_world::simulation::Level;
use scindo_world::snapshot::Snapshot;
use triple_buffer::Input;

use crate::exchange::{Exchange, Outgoing};
use crate::inbox::{Answering, Refusal};
use crate::record::recorder::StateMessages;
use engine::Engine;

/// How often a paused simulation checks for new listeners.
const STILL: Duration = Duration::from_millis(10);

/// A simulation that is later than this gives up the lost time instead of catching up.
const MOST_BEHIND: Duration = Duration::from_millis(250);

/// The plan, with its costs and listeners, is sent this often.
const PLAN_PERIOD: Duration = Duration::from_secs(1);

/// After this many panics in a row the simulation is paused.
const MOST_PANICS: u32 = 3;

/// An order that a client sends by rpc.
#[derive(Debug, Clone, PartialEq)]
pub enum Order {
    /// Pause (`true`) or go on (`false`).
    Pause(bool),
    /// Make this many steps while paused.
    Step(u32),
    /// Go back to the start of the scene.
    Reset,
    /// Take the last cut back.
    Undo,
    /// Keep the present state under this name.
    Snapshot(String),
    /// Go back to the state with this name.
    Restore(String),
    /// Begin (`true`) or end a recording.
    Record(bool),
    /// Hand the present state over.
    State,
    /// Change a parameter of the scene.
    Set {
        /// Key, as in the scene file.
        key: String,
        /// Value, as in the scene file.
        value: String,
    },
}

/// An order and the channel of its answer.
pub struct Command {
    /// The requested action.
    pub order: Order,
    /// Channel that takes one answer.
    pub answer: Sender<Answer>,
}

/// The answer to an order.
pub struct Answer {
    /// What the client receives.
    pub reply: RpcReply,
    /// The state, if that was the order and it could be read.
    pub state: Option<StateMessages>,
}

impl From<RpcReply> for Answer {
    fn from(reply: RpcReply) -> Self {
        Self { reply, state: None }
    }
}

/// How fast and how long the simulation runs.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pace {
    /// Run as fast as possible instead of in real time.
    pub fast: bool,
    /// End after this many steps; `None` runs until stopped.
    pub steps: Option<u64>,
}

/// State of the simulation thread.
pub struct SimThread {
    engine: Engine,
    exchange: Arc<Exchange>,
    commands: Receiver<Command>,
    to_publish: Input<Snapshot>,
    to_contact: Input<Snapshot>,
    pace: Pace,
    inputs: Inputs,
    wanted: Wants,
    step: u64,
    next_step: Instant,
    /// Steps that a paused simulation still has to make, and the client that waits for them.
    owed: Option<(u32, Sender<Answer>)>,
    panics: u32,
    next_plan: Instant,
    body_ids: Vec<String>,
}

impl SimThread {
    /// Creates the thread's state before the first step.
    pub fn new(
        engine: Engine,
        exchange: Arc<Exchange>,
        commands: Receiver<Command>,
        (to_publish, to_contact): (Input<Snapshot>, Input<Snapshot>),
        pace: Pace,
    ) -> Self {
        exchange.set_params(engine.params());
        let body_ids = engine.info().bodies.into_iter().map(|body| body.id).collect();
        Self {
            body_ids,
            engine,
            exchange,
            commands,
            to_publish,
            to_contact,
            pace,
            inputs: Inputs::default(),
            wanted: Wants::default(),
            step: 0,
            next_step: Instant::now(),
            owed: None,
            panics: 0,
            next_plan: Instant::now() + PLAN_PERIOD,
        }
    }

    /// Steps until told to stop or done. Returns the engine for its results.
    pub fn run(mut self) -> Engine {
        let _ended = Ended(self.exchange.clone());
        self.engine.set_stop_flag(self.exchange.break_off_flag());
        self.hand_over();
        while !self.exchange.stopping() && !self.done() {
            self.obey();
            if self.holds_still() {
                self.wait_still();
                continue;
            }
            let start = Instant::now();
            self.read_inputs();
            self.advance();
            self.hand_over();
            if !self.pace.fast && self.owed.is_none() {
                self.engine.govern(start.elapsed());
            }
            self.report();
            self.keep_pace();
        }
        self.discard_cuts("the server is shutting down");
        self.engine
    }

    fn done(&self) -> bool {
        self.pace.steps.is_some_and(|steps| self.step >= steps)
    }

    fn holds_still(&self) -> bool {
        self.exchange.paused.load(Ordering::Relaxed) && self.owed.is_none()
    }

    /// Waits while paused. Somebody may still begin to watch or give an order.
    fn wait_still(&mut self) {
        let mut wants = Wants::default();
        self.exchange.wants_into(&mut wants);
        if wants != self.wanted {
            self.hand_over();
        }
        if let Ok(command) = self.commands.recv_timeout(STILL) {
            self.carry_out(command);
        }
        self.next_step = Instant::now();
    }

    fn obey(&mut self) {
        self.exchange.orders_taken();
        while let Ok(command) = self.commands.try_recv() {
            self.carry_out(command);
        }
    }

    fn carry_out(&mut self, Command { order, answer }: Command) {
        self.exchange.orders_taken();
        let reply = match order {
            Order::Pause(paused) => {
                self.exchange.paused.store(paused, Ordering::Relaxed);
                Ok(if paused { "paused".to_owned() } else { "running".to_owned() })
            }
            Order::Step(count) => {
                if self.holds_still() {
                    self.owed = Some((count, answer));
                    return;
                }
                Err(Refusal {
                    code: "not-paused",
                    message: "only a paused simulation can be stepped".to_owned(),
                    hint: "send rpc/pause first",
                })
            }
            Order::Reset => self.reset(),
            Order::Undo => self.undo(),
            Order::Snapshot(name) => self.snapshot(&name),
            Order::Restore(name) => self.restore(&name),
            Order::Record(on) => self.record(on),
            Order::State => {
                let _ = answer.try_send(self.state());
                return;
            }
            Order::Set { key, value } => self.set(&key, &value),
        };
        // The client may have given up waiting.
        let _ = answer.try_send(self.reply(reply).into());
    }

    fn record(&mut self, on: bool) -> Result<String, Refusal> {
        let done = if on { self.engine.begin_recording() } else { self.engine.end_recording() };
        let file = done.map_err(|message| Refusal {
            code: "cannot-record",
            message,
            hint: "start the server with --recordings FOLDER, and record one at a time",
        })?;
        if on {
            self.exchange.event(Level::Info, "recording", format!("{file} is being recorded"));
        }
        self.exchange.set_recording(self.engine.recording());
        Ok(file)
    }

    fn state(&self) -> Answer {
        let refusal = |message| Refusal {
            code: "cannot-send-state",
            message,
            hint: "rpc/record writes states of any size to the disk of the server",
        };
        match self.engine.state_messages() {
            Ok(state) => Answer { reply: self.reply(Ok("read".to_owned())), state: Some(state) },
            Err(message) => self.reply(Err(refusal(message))).into(),
        }
    }

    fn reset(&mut self) -> Result<String, Refusal> {
        self.discard_cuts("the scene was reset before the cut was made");
        self.engine.reset().map_err(|message| Refusal {
            code: "cannot-reset",
            message,
            hint: "start the server again",
        })?;
        self.announce_plan();
        self.exchange.event(Level::Info, "reset", "back at the start of the scene".to_owned());
        self.hand_over();
        Ok("at the start".to_owned())
    }

    /// Answers every waiting cut, here and in the simulation, with `reason`: none of them will be made.
    fn discard_cuts(&mut self, reason: &str) {
        let (step, epochs) = (self.step, self.epochs());
        let hint = "send it again with a new number";
        let with = Answering { step, epochs: &epochs, code: "cut-discarded", hint };
        let begun = self.engine.discard_cuts(reason);
        let mut inbox = self.exchange.inbox();
        let mut answers = inbox.finish(&begun, &with);
        answers.extend(inbox.discard(reason, &with));
        drop(inbox);
        answers.into_iter().for_each(|answer| self.exchange.answer(answer));
    }

    fn epochs(&self) -> Vec<BodyEpoch> {
        let bodies = self.body_ids.iter().enumerate();
        bodies.map(|(i, id)| BodyEpoch { body_id: id.clone(), epoch: self.exchange.epoch(i) }).collect()
    }

    /// Takes the last cut back. The log of cuts stays, so a repetition of that cut is still a duplicate.
    fn undo(&mut self) -> Result<String, Refusal> {
        let message = self.engine.undo().map_err(|message| Refusal {
            code: "cannot-undo",
            message,
            hint: "rpc/reset undoes every cut",
        })?;
        self.announce_plan();
        self.exchange.event(Level::Info, "cut-undone", message.clone());
        self.hand_over();
        Ok(message)
    }

    fn snapshot(&mut self, name: &str) -> Result<String, Refusal> {
        let message = self.engine.snapshot(name).map_err(|message| Refusal {
            code: "cannot-snapshot",
            message,
            hint: "a snapshot is a name of 1 to 64 of a-z 0-9 - _; 16 of them and 1 GiB are kept",
        })?;
        self.exchange.event(Level::Info, "snapshot", message.clone());
        Ok(message)
    }

    /// Goes back to a state that was kept. Cuts that wait now belong to the time after it and are answered.
    fn restore(&mut self, name: &str) -> Result<String, Refusal> {
        let refusal = |message| Refusal {
            code: "cannot-restore",
            message,
            hint: "rpc/snapshot keeps the present state under a name",
        };
        if !self.engine.has_snapshot(name) {
            return self.engine.restore(name).map_err(refusal);
        }
        self.discard_cuts("an earlier state was restored before the cut was made");
        let message = self.engine.restore(name).map_err(refusal)?;
        self.exchange.set_params(self.engine.params());
        self.announce_plan();
        self.exchange.event(Level::Info, "restored", message.clone());
        self.hand_over();
        Ok(message)
    }

    fn set(&mut self, key: &str, value: &str) -> Result<String, Refusal> {
        self.engine.set(key, value).map_err(|message| Refusal {
            code: "cannot-set",
            message,
            hint: "rpc/params lists the keys, their values and ranges",
        })?;
        self.exchange.set_params(self.engine.params());
        self.announce_plan();
        self.exchange.event(Level::Info, "set", format!("{key} = {value}"));
        Ok(format!("{key} = {value}"))
    }

    fn reply(&self, result: Result<String, Refusal>) -> RpcReply {
        let (ok, message, error) = match result {
            Ok(message) => (true, message, None),
            Err(refusal) => (false, String::new(), Some(refusal.into())),
        };
        RpcReply { ok, sim_step: self.step, message, error }
    }

    fn announce_plan(&self) {
        self.exchange.send(Outgoing::Plan(self.engine.plan()));
    }

    fn read_inputs(&mut self) {
        self.exchange.wants_into(&mut self.inputs.wants);
        self.exchange.inbox().take(&mut self.inputs);
    }

    /// Makes one step. A panic costs the state but not the server: the scene starts again.
    fn advance(&mut self) {
        let (engine, inputs) = (&mut self.engine, &self.inputs);
        if catch_unwind(AssertUnwindSafe(|| engine.step(inputs))).is_ok() {
            self.panics = 0;
        } else {
            self.recover();
        }
        // Panicked steps count as well: a run of so many steps must end.
        self.step += 1;
        self.exchange.sim_step.store(self.step, Ordering::Relaxed);
        if let Some((count, answer)) = self.owed.take() {
            if count > 1 {
                self.owed = Some((count - 1, answer));
            } else {
                let _ = answer.try_send(self.reply(Ok("stepped".to_owned())).into());
            }
        }
    }

    fn recover(&mut self) {
        self.panics += 1;
        self.engine.count_panic();
        self.exchange.step_panicked();
        self.discard_cuts("a step panicked, and the scene restarts");
        let reset = matches!(catch_unwind(AssertUnwindSafe(|| self.engine.reset())), Ok(Ok(())));
        let message = format!("step {} panicked; the scene restarts", self.step);
        self.exchange.event(Level::Error, "step-panicked", message);
        if !reset || self.panics >= MOST_PANICS {
            self.exchange.paused.store(true, Ordering::Relaxed);
            let message =
                "paused after repeated panics; send rpc/reset, then rpc/pause with paused = false, to resume"
                    .to_owned();
            self.exchange.event(Level::Error, "paused", message);
        }
    }

    /// Reports a step: times to the meter, notes as events, answers to the clients that cut.
    fn report(&mut self) {
        if Instant::now() >= self.next_plan {
            self.next_plan = Instant::now() + PLAN_PERIOD;
            self.announce_plan();
        }
        if let Some(reason) = self.engine.take_recording_failure() {
            let message = format!("the recording ends at this step, the simulation goes on: {reason}");
            self.exchange.event(Level::Error, "recording-ended", message);
        }
        self.report_recordings();
        let report = self.engine.report();
        self.exchange.meter.step(report.seconds.iter());
        if let Some(metrics) = self.exchange.metrics.get() {
            metrics.step(report.seconds.iter());
        }
        for event in &report.events {
            let body = event.body.as_deref().map_or(String::new(), |id| format!("{id}: "));
            self.exchange.event(event.level, event.name, format!("{body}{}", event.message));
        }
        if report.cuts.is_empty() {
            return;
        }
        let epochs = self.epochs();
        let hint = "change the sweep or reset the scene, and send it with a new number";
        let with = Answering { step: self.step, epochs: &epochs, code: "cut-failed", hint };
        let answers = self.exchange.inbox().finish(&report.cuts, &with);
        for answer in answers {
            let message = match &answer.error {
                None => format!(
                    "'{}' cut {} elements with '{}'",
                    answer.client_id, answer.elements_cut, answer.tool_id
                ),
                Some(error) => format!("cut of '{}' failed: {}", answer.client_id, error.message),
            };
            let (level, name) = match answer.error {
                None => (Level::Info, "cut-answered"),
                Some(_) => (Level::Warning, "cut-failed"),
            };
            self.exchange.event(level, name, message);
            self.exchange.answer(answer);
        }
    }

    /// Tells how long the recording is, and which files are complete.
    fn report_recordings(&mut self) {
        while let Some((RecordingStats { file, seconds, .. }, ended)) = self.engine.take_ended_recording() {
            let (level, message) = match ended {
                Ok(()) => (Level::Info, format!("{file} is complete, {seconds:.0} s")),
                Err(error) => (Level::Error, error.to_string()),
            };
            self.exchange.event(level, "recording-ended", message);
        }
        self.exchange.set_recording(self.engine.recording());
    }

    /// Hands fresh snapshots to the publisher and, while somebody holds a tool, to the contact thread. A run
    /// as fast as possible skips the publisher while the last snapshot is unread.
    fn hand_over(&mut self) {
        self.exchange.wants_into(&mut self.wanted);
        if !self.pace.fast || self.to_publish.consumed() || !self.inputs.cuts.is_empty() {
            let snapshot = self.to_publish.input_buffer_mut();
            self.engine.snapshot_into(&self.wanted, snapshot);
            for (index, body) in snapshot.bodies.iter().enumerate() {
                self.exchange.set_epoch(index, body.epoch);
            }
            self.to_publish.publish();
        }
        if self.wanted.contact {
            self.engine.snapshot_into(&self.wanted, self.to_contact.input_buffer_mut());
            self.to_contact.publish();
        }
    }

    /// Waits until the next step is due, and carries out orders meanwhile.
    fn keep_pace(&mut self) {
        if self.pace.fast || self.owed.is_some() {
            return;
        }
        self.next_step += Duration::from_secs_f64(self.engine.step_s());
        let now = Instant::now();
        if now > self.next_step + MOST_BEHIND {
            self.next_step = now;
        }
        loop {
            match self.commands.recv_deadline(self.next_step) {
                Ok(command) => self.carry_out(command),
                Err(RecvTimeoutError::Timeout) => return,
                Err(RecvTimeoutError::Disconnected) => {
                    std::thread::sleep(self.next_step.saturating_duration_since(Instant::now()));
                    return;
                }
            }
        }
    }
}

/// Reports the end of the simulation thread when dropped, even after a panic.
struct Ended(Arc<Exchange>);

impl Drop for Ended {
    fn drop(&mut self) {
        self.0.has_simulated();
    }
}
