//! Logs, request ids and metrics. How log lines are written is in [`super::log_queue`]. Metric labels come from a small fixed set: never an id or a caller's path.

use std::{
    io::{self, IsTerminal},
    panic,
    time::Duration,
};

use axum::http::{HeaderMap, HeaderName};
use clap::ValueEnum;
use metrics::{Counter, Gauge, Histogram, Key, Label, Level, Metadata, Recorder as _, Unit};
use metrics_exporter_prometheus::{
    BuildError, PrometheusBuilder, PrometheusHandle, PrometheusRecorder,
};
use tracing::{dispatcher, error};
use tracing_subscriber::filter::{ParseError, Targets};
use tracing_subscriber::fmt::{layer, writer::BoxMakeWriter};
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{Registry, registry};
use uuid::Uuid;

use super::{
    log_queue::{self, LogGuard, LogQueue, PatientStderr},
    traces,
};
use darn_contract::v1;

/// The header that carries a request's id, in requests and answers.
pub const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// How long the service took until its answer began, in milliseconds (W3C Server Timing).
pub const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// A request's id, as a request extension.
#[derive(Debug, Clone)]
pub struct RequestId(pub String);

impl RequestId {
    /// The caller's id if it has at most 128 letters, digits, `-`, `_` or `.`; else a new one.
    pub fn of(headers: &HeaderMap) -> Self {
        let is_plain = |id: &&str| {
            (1..=128).contains(&id.len())
                && id
                    .bytes()
                    .all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b))
        };
        (headers.get(REQUEST_ID))
            .and_then(|value| value.to_str().ok())
            .filter(is_plain)
            .map_or_else(
                || Self(Uuid::new_v4().to_string()),
                |id| Self(id.to_owned()),
            )
    }
}

/// How log lines look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For a person.
    Text,
    /// One JSON object a line.
    Json,
}

/// Who waits when the reader of the log is slow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LogDelivery {
    /// Nobody: lines wait in a queue of bounded size; those that find no room are dropped and counted. For a service.
    Queued,
    /// Whoever logs: no line is dropped unless standard error refuses it. For a command.
    Patient,
}

/// Why logging was not started.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The filter does not parse.
    #[error("{0}")]
    Filter(#[from] ParseError),
    /// The thread that writes the lines cannot be started.
    #[error("the thread that writes the log cannot be started: {0}")]
    Thread(#[from] io::Error),
}

/// Starts logging to standard error and logs panics; an error of standard error is never one of whoever logs. A second call does nothing.
/// Drop the guard at the end of the process.
///
/// # Errors
/// See [`LogError`].
pub fn start_logging(
    filter: &str,
    format: LogFormat,
    delivery: LogDelivery,
) -> Result<LogGuard, LogError> {
    // Not `EnvFilter`: its span filters would cost a regular expression engine, a tenth of a first build.
    let filter: Targets = filter.parse()?;
    // A test or an embedding program has already set a subscriber, which is kept.
    if dispatcher::has_been_set() {
        return Ok(LogGuard::new());
    }
    let writer = match delivery {
        LogDelivery::Queued => BoxMakeWriter::new(LogQueue::of_process()?.clone()),
        LogDelivery::Patient => BoxMakeWriter::new(|| PatientStderr),
    };
    let lines = layer()
        .with_writer(writer)
        .with_ansi(io::stderr().is_terminal())
        // It would say them with `eprintln!`, which panics when standard error fails.
        .log_internal_errors(false);
    let lines: Box<dyn Layer<Registry> + Send + Sync> = match format {
        LogFormat::Text => lines.boxed(),
        LogFormat::Json => lines
            .json()
            .flatten_event(true)
            .with_span_list(false)
            .boxed(),
    };
    let started = registry().with(lines.with_filter(filter)).try_init();
    if started.is_ok() {
        panic::set_hook(Box::new(|info| {
            let message = info.payload_as_str().unwrap_or("no message");
            let place = info.location().map(ToString::to_string).unwrap_or_default();
            error!(message, place, "panicked");
        }));
    }
    Ok(LogGuard::new())
}

/// The metrics of the worker pool.
#[derive(Debug)]
pub struct PoolMetrics {
    /// Jobs waiting.
    pub waiting: Gauge,
    /// Jobs running.
    pub running: Gauge,
    /// Seconds a job waited.
    pub waited: Histogram,
    /// Jobs dropped before they began, because the caller left or the deadline passed.
    pub skipped: Counter,
    /// Jobs whose caller left before the result.
    pub discarded: Counter,
    /// Jobs that panicked.
    pub panicked: Counter,
}

/// The metrics of the sessions.
#[derive(Debug)]
pub struct SessionMetrics {
    /// Sessions open.
    pub open: Gauge,
    /// Bytes they take together.
    pub bytes: Gauge,
    /// Requests that use a session or wait for it.
    pub requests: Gauge,
    /// Sessions opened.
    pub opened: Counter,
    /// Sessions ended because they were idle.
    pub expired: Counter,
    /// Sessions ended for their memory.
    pub evicted: Counter,
    /// Sessions deleted by their owners.
    pub deleted: Counter,
}

/// The service's metrics. They have their own recorder, so that two services in one process do not share counts.
pub struct Metrics {
    recorder: PrometheusRecorder,
    handle: PrometheusHandle,
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metrics").finish_non_exhaustive()
    }
}

/// Upper bounds of the histograms' buckets, in seconds.
const BUCKETS: [f64; 15] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0,
];
/// The counter of log lines that were not written.
const LOG_LINES_DROPPED: &str = "darn_log_lines_dropped_total";
const METADATA: Metadata<'static> = Metadata::new("darn", Level::INFO, None);

impl Metrics {
    /// Metrics that have counted nothing.
    ///
    /// # Errors
    /// None in practice: they would concern the constant buckets.
    pub fn new() -> Result<Self, BuildError> {
        let recorder = PrometheusBuilder::new()
            .set_buckets(&BUCKETS)?
            .build_recorder();
        let seconds = Some(Unit::Seconds);
        recorder.describe_histogram(
            "darn_request_seconds".into(),
            seconds,
            "time to answer".into(),
        );
        recorder.describe_histogram(
            "darn_stage_seconds".into(),
            seconds,
            "time in a stage of mending".into(),
        );
        recorder.describe_counter(
            "darn_requests_total".into(),
            None,
            "requests answered".into(),
        );
        recorder.describe_counter(
            "darn_jobs_total".into(),
            None,
            "jobs with an unusual end".into(),
        );
        recorder.describe_counter(
            "darn_holes_filled_total".into(),
            None,
            "holes filled".into(),
        );
        recorder.describe_gauge(
            "darn_jobs".into(),
            None,
            "requests and jobs in the worker pool, waiting and running".into(),
        );
        recorder.describe_gauge(
            "darn_jobs_waiting".into(),
            None,
            "durable jobs that wait".into(),
        );
        recorder.describe_gauge(
            "darn_jobs_running".into(),
            None,
            "durable jobs that run".into(),
        );
        recorder.describe_counter(
            "darn_webhooks_total".into(),
            None,
            "tries to tell a webhook of a job's end, by what came of them".into(),
        );
        recorder.describe_histogram(
            "darn_webhook_seconds".into(),
            seconds,
            "time of a try to tell a webhook".into(),
        );
        recorder.describe_gauge(
            "darn_webhooks_waiting".into(),
            None,
            "ends of jobs that webhooks are still to be told of".into(),
        );
        recorder.describe_gauge("darn_sessions".into(), None, "sessions open".into());
        recorder.describe_gauge(
            "darn_session_bytes".into(),
            Some(Unit::Bytes),
            "bytes that open sessions take".into(),
        );
        recorder.describe_gauge(
            "darn_session_requests".into(),
            None,
            "requests that use a session or wait for their turn".into(),
        );
        recorder.describe_counter(
            "darn_sessions_opened_total".into(),
            None,
            "sessions opened".into(),
        );
        recorder.describe_counter(
            "darn_sessions_ended_total".into(),
            None,
            "sessions ended, by reason".into(),
        );
        recorder.describe_counter(
            LOG_LINES_DROPPED.into(),
            None,
            "log lines of this process that were not written, by reason".into(),
        );
        let handle = recorder.handle();
        Ok(Self { recorder, handle })
    }

    /// The metrics of the worker pool.
    pub fn pool(&self) -> PoolMetrics {
        PoolMetrics {
            waiting: self.gauge("darn_jobs", "state", "waiting"),
            running: self.gauge("darn_jobs", "state", "running"),
            waited: self.histogram("darn_stage_seconds", "stage", "queue"),
            skipped: self.counter("darn_jobs_total", vec![Label::new("end", "skipped")]),
            discarded: self.counter("darn_jobs_total", vec![Label::new("end", "discarded")]),
            panicked: self.counter("darn_jobs_total", vec![Label::new("end", "panicked")]),
        }
    }

    /// The metrics of the sessions.
    pub fn sessions(&self) -> SessionMetrics {
        let ended = |reason: &str| {
            let labels = vec![Label::new("reason", reason.to_owned())];
            self.counter("darn_sessions_ended_total", labels)
        };
        let gauge = |name| (self.recorder).register_gauge(&Key::from_name(name), &METADATA);
        SessionMetrics {
            open: gauge("darn_sessions"),
            bytes: gauge("darn_session_bytes"),
            requests: gauge("darn_session_requests"),
            opened: self.counter("darn_sessions_opened_total", Vec::new()),
            expired: ended("idle"),
            evicted: ended("evicted"),
            deleted: ended("deleted"),
        }
    }

    /// Sets how many durable jobs wait and run.
    pub fn durable_jobs(&self, waiting: i64, running: i64) {
        self.set("darn_jobs_waiting", waiting);
        self.set("darn_jobs_running", running);
    }

    /// Sets how many ends of jobs webhooks are still to be told of.
    pub fn webhooks_waiting(&self, waiting: i64) {
        self.set("darn_webhooks_waiting", waiting);
    }

    fn set(&self, name: &'static str, value: i64) {
        let gauge = self
            .recorder
            .register_gauge(&Key::from_name(name), &METADATA);
        gauge.set(value as f64);
    }

    /// Records a try to tell a webhook; `end` is what came of it.
    pub fn webhook_tried(&self, end: &'static str, took: Duration) {
        self.counter("darn_webhooks_total", vec![Label::new("end", end)])
            .increment(1);
        let key = Key::from_name("darn_webhook_seconds");
        let times = self.recorder.register_histogram(&key, &METADATA);
        times.record(took.as_secs_f64());
    }

    /// Records an answer; `route` is the route's pattern, not the caller's path.
    pub fn answered(&self, route: &str, status: u16, took: Duration) {
        let labels = vec![
            Label::new("route", route.to_owned()),
            Label::new("status", status.to_string()),
        ];
        self.counter("darn_requests_total", labels).increment(1);
        self.histogram("darn_request_seconds", "route", route)
            .record(took.as_secs_f64());
    }

    /// Records the holes and the stage timings of a mend, also in the present trace.
    pub fn mended(&self, report: &v1::Report) {
        traces::stage_spans(report);
        self.counter("darn_holes_filled_total", Vec::new())
            .increment(report.holes.len() as u64);
        if let Some(t) = &report.timings {
            self.record_stages(&[
                ("read", t.read),
                ("weld", t.weld),
                ("loops", t.loops),
                ("holes", t.holes),
                ("write", t.write),
                ("total", t.total),
            ]);
        }
        for t in report.holes.iter().filter_map(|hole| hole.timings.as_ref()) {
            self.record_stages(&[
                ("region", t.region),
                ("flatten", t.flatten),
                ("raster", t.raster),
                ("net", t.net),
                ("patch", t.patch),
                ("report", t.report),
            ]);
        }
    }

    fn record_stages(&self, milliseconds: &[(&str, f64)]) {
        for (stage, ms) in milliseconds {
            self.histogram("darn_stage_seconds", "stage", stage)
                .record(ms / 1000.0);
        }
    }

    /// The metrics in the Prometheus text format.
    pub fn render(&self) -> String {
        let dropped = log_queue::dropped_lines();
        for (reason, lines) in [
            ("queue_full", dropped.queue_full),
            ("write_failed", dropped.write_failed),
        ] {
            self.counter(LOG_LINES_DROPPED, vec![Label::new("reason", reason)])
                .absolute(lines);
        }
        self.handle.render()
    }

    /// Aggregates recorded samples into their buckets; without it samples accumulate while nobody reads the metrics.
    pub fn upkeep(&self) {
        self.handle.run_upkeep();
    }

    fn counter(&self, name: &'static str, labels: Vec<Label>) -> Counter {
        self.recorder
            .register_counter(&Key::from_parts(name, labels), &METADATA)
    }

    fn gauge(&self, name: &'static str, label: &'static str, value: &str) -> Gauge {
        let key = Key::from_parts(name, vec![Label::new(label, value.to_owned())]);
        self.recorder.register_gauge(&key, &METADATA)
    }

    fn histogram(&self, name: &'static str, label: &'static str, value: &str) -> Histogram {
        let key = Key::from_parts(name, vec![Label::new(label, value.to_owned())]);
        self.recorder.register_histogram(&key, &METADATA)
    }
}
