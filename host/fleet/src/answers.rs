//! The source of answers to calls: plugins, a recording, or a recording and then plugins.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use fleetyard_abi::SharedEnvironment;
use fleetyard_core::InputError;

use crate::call::{Answer, Call, Pipeline};
use crate::modules::Module;
use crate::recording::{End, Recording, Round};
use crate::run::Watch;
use crate::{By, FleetError};

/// The source of answers; `P` are the plugins.
pub(crate) enum Answers<P> {
    /// Plugins answer.
    Live(P),
    /// A recording answers, without any plugin.
    Recorded(Replay),
    /// A recording answers, and plugins from its end on.
    RecordedThenLive(Replay, P),
}

impl<P> Answers<P> {
    /// The same with plugins that were started.
    pub(crate) fn start<Q>(
        self,
        start: impl FnOnce(P) -> Result<Q, FleetError>,
    ) -> Result<Answers<Q>, FleetError> {
        Ok(match self {
            Self::Live(plugins) => Answers::Live(start(plugins)?),
            Self::Recorded(replay) => Answers::Recorded(replay),
            Self::RecordedThenLive(replay, plugins) => {
                Answers::RecordedThenLive(replay, start(plugins)?)
            }
        })
    }

    /// The recording that is replayed, if one is.
    pub(crate) fn replay(&self) -> Option<&Replay> {
        match self {
            Self::Live(_) => None,
            Self::Recorded(replay) | Self::RecordedThenLive(replay, _) => Some(replay),
        }
    }

    /// The next call of the recording, if there is one.
    pub(crate) fn recorded(&self) -> Option<&Round> {
        self.replay()?.next()
    }

    /// Takes the next call of the recording.
    pub(crate) fn advance(&mut self) -> Result<Round, FleetError> {
        match self {
            Self::Live(_) => Err(broken()),
            Self::Recorded(replay) | Self::RecordedThenLive(replay, _) => replay.advance(),
        }
    }

    /// The plugins if they are asked the next recorded call again: the last one, if the planner
    /// had answered it, so that the answers can be compared.
    pub(crate) fn asked_again(&self) -> Option<&P> {
        let Self::RecordedThenLive(replay, plugins) = self else {
            return None;
        };
        let round = replay.next()?;
        let is_last = round.call + 1 == replay.recording.rounds();
        (is_last && round.by == By::Planner).then_some(plugins)
    }

    /// The plugins; an error in a replay.
    pub(crate) fn plugins(&self) -> Result<&P, FleetError> {
        match self {
            Self::Live(plugins) | Self::RecordedThenLive(_, plugins) => Ok(plugins),
            Self::Recorded(_) => Err(broken()),
        }
    }

    /// The plugins, to be changed; an error in a replay.
    pub(crate) fn plugins_mut(&mut self) -> Result<&mut P, FleetError> {
        match self {
            Self::Live(plugins) | Self::RecordedThenLive(_, plugins) => Ok(plugins),
            Self::Recorded(_) => Err(broken()),
        }
    }

    /// The error for an answer that cannot take effect.
    pub(crate) fn wrong(&self, round: &Round, reason: String) -> FleetError {
        let Some(replay) = self.replay() else {
            return FleetError::Broken(reason);
        };
        InputError::new(replay.recording.name(), reason)
            .at_line(round.line)
            .hint("the file was changed, or was recorded by another version of this program")
            .into()
    }
}

impl Answers<Plugins> {
    /// Ends the plugins; those that answer calls only if there is the time to wait for them.
    pub(crate) fn close(&mut self, watch: &mut dyn Watch, all: bool) -> Result<(), FleetError> {
        self.plugins_mut()
            .map_or(Ok(()), |plugins| plugins.close(watch, all))
    }
}

/// A recording and its next call.
pub(crate) struct Replay {
    recording: Recording,
    next: Option<Round>,
}

impl Replay {
    /// Before the first call.
    pub(crate) fn new(mut recording: Recording) -> Result<Self, FleetError> {
        let next = recording.next()?;
        Ok(Self { recording, next })
    }

    /// The file.
    pub(crate) fn recording(&self) -> &Recording {
        &self.recording
    }

    /// The next call, if there is one.
    pub(crate) fn next(&self) -> Option<&Round> {
        self.next.as_ref()
    }

    fn advance(&mut self) -> Result<Round, FleetError> {
        std::mem::replace(&mut self.next, self.recording.next()?).ok_or_else(broken)
    }

    /// Compares the end of a replay with the recorded one.
    pub(crate) fn came_out(&self, end: &End) -> Result<(), FleetError> {
        let recorded = self.recording.end().map(|end| end.trace_digest);
        if recorded.is_none_or(|recorded| recorded == end.trace_digest) {
            return Ok(());
        }
        let reason = "the replay came out otherwise than the recording says";
        Err(InputError::new(self.recording.name(), reason)
            .hint("was it recorded by another version of this program?")
            .into())
    }
}

/// Plugins that were started: the invocation policy here, the others on a thread of their own.
pub(crate) struct Plugins {
    thread: Option<Thread>,
    pub(crate) invocation: Module,
    pub(crate) environment: SharedEnvironment,
}

/// The thread that answers calls, and the channels to it.
struct Thread {
    calls: SyncSender<Call>,
    answers: Receiver<Answer>,
    handle: JoinHandle<Pipeline>,
}

impl Plugins {
    /// Starts the thread.
    pub(crate) fn start(
        mut pipeline: Pipeline,
        invocation: Module,
        environment: SharedEnvironment,
    ) -> Result<Self, FleetError> {
        let (calls, called) = sync_channel::<Call>(1);
        let (answer, answers) = sync_channel(1);
        let handle = std::thread::Builder::new()
            .name("calls".into())
            .spawn(move || {
                while let Ok(call) = called.recv() {
                    if answer.send(pipeline.answer(&call)).is_err() {
                        break;
                    }
                }
                pipeline
            })
            .map_err(|error| FleetError::Broken(format!("no thread for calls: {error}")))?;
        Ok(Self {
            thread: Some(Thread {
                calls,
                answers,
                handle,
            }),
            invocation,
            environment,
        })
    }

    fn thread(&self) -> Result<&Thread, FleetError> {
        self.thread.as_ref().ok_or_else(broken)
    }

    /// Makes a call, which is answered later.
    pub(crate) fn call(&self, call: Call) -> Result<(), FleetError> {
        self.thread()?.calls.send(call).map_err(|_| broken())
    }

    /// The answer to the call, if it is there.
    pub(crate) fn answer(&self) -> Result<Option<Answer>, FleetError> {
        match self.thread()?.answers.try_recv() {
            Ok(answer) => Ok(Some(answer)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(broken()),
        }
    }

    /// Waits for the answer to the call; none if the run was told to end.
    pub(crate) fn wait(&self, watch: &dyn Watch) -> Result<Option<Answer>, FleetError> {
        let answers = &self.thread()?.answers;
        loop {
            match answers.recv_timeout(Duration::from_millis(100)) {
                Ok(answer) => return Ok(Some(answer)),
                Err(RecvTimeoutError::Timeout) if watch.is_interrupted() => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(broken()),
            }
        }
    }

    fn close(&mut self, watch: &mut dyn Watch, all: bool) -> Result<(), FleetError> {
        let Some(Thread { handle, .. }) = self.thread.take() else {
            return Ok(());
        };
        let mut others = Vec::new();
        if all {
            // The thread ends, for nobody calls it any more.
            let pipeline = handle.join().map_err(|_| broken())?;
            others.extend(pipeline.into_modules());
        }
        for module in std::iter::once(&mut self.invocation).chain(&mut others) {
            if let Some(closing) = module.close() {
                watch.closed(module.info(), closing);
            }
            if let Some(fault) = module.unsupervised() {
                watch.unsupervised(module.info(), fault);
            }
        }
        Ok(())
    }
}

/// The error of a run whose thread is gone.
pub(crate) fn broken() -> FleetError {
    FleetError::Broken("the thread that answers calls has ended".into())
}
