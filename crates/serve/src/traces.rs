//! Traces over OTLP (OpenTelemetry): a span for each request and each attempt at a job, and below it where its time went.
//!
//! On only where the standard variables name a collector (`OTEL_EXPORTER_OTLP_ENDPOINT` or `OTEL_EXPORTER_OTLP_TRACES_ENDPOINT`); all `OTEL_*`
//! variables of the SDK apply. Spans are sent by a thread of their own, in batches; where the collector is slow they are dropped, and no
//! request waits. Names and attributes follow the semantic conventions for HTTP servers; no attribute has a caller's path or query.

use std::{
    env,
    time::{Duration, SystemTime},
};

use axum::http::HeaderMap;
use opentelemetry::{
    Context, KeyValue, global,
    propagation::{Extractor, TextMapPropagator as _},
    trace::{
        Link, SpanBuilder, SpanContext, SpanKind, Status, TraceContextExt as _, TraceFlags,
        Tracer as _,
    },
};
use opentelemetry_otlp::{ExporterBuildError, SpanExporter};
use opentelemetry_sdk::{Resource, propagation::TraceContextPropagator, trace::SdkTracerProvider};
use tracing::warn;

use super::tls;
use darn_contract::v1;

/// The variables that turn traces on.
const ENDPOINTS: [&str; 2] = [
    "OTEL_EXPORTER_OTLP_ENDPOINT",
    "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT",
];
/// Longest time in which the last spans are sent at the end.
const LAST_SPANS: Duration = Duration::from_secs(3);
/// Who makes the spans.
const SCOPE: &str = "darn";
/// The header of a caller's span (W3C Trace Context).
const TRACE_PARENT: &str = "traceparent";

/// Sends the last spans when dropped.
#[derive(Debug)]
pub struct TraceGuard(SdkTracerProvider);

impl Drop for TraceGuard {
    fn drop(&mut self) {
        if let Err(error) = self.0.shutdown_with_timeout(LAST_SPANS) {
            warn!(%error, "the last spans were not sent");
        }
    }
}

/// Starts traces where the variables ask for them; `None` where they do not.
///
/// # Errors
/// A variable that the exporter cannot use.
#[expect(
    clippy::disallowed_methods,
    reason = "the variables are OpenTelemetry's; the exporter itself reads the others"
)]
pub fn start_traces() -> Result<Option<TraceGuard>, ExporterBuildError> {
    let says =
        |name: &str, value: &str| env::var(name).is_ok_and(|it| it.eq_ignore_ascii_case(value));
    let has_endpoint = ENDPOINTS
        .iter()
        .any(|name| env::var_os(name).is_some_and(|it| !it.is_empty()));
    if !has_endpoint || says("OTEL_SDK_DISABLED", "true") || says("OTEL_TRACES_EXPORTER", "none") {
        return Ok(None);
    }
    // For collectors that are reached over TLS. Already set where something else in the process has chosen.
    tls::provider().as_ref().clone().install_default().ok();
    let exporter = SpanExporter::builder().with_http().build()?;
    let mut resource = Resource::builder()
        .with_attribute(KeyValue::new("service.version", env!("CARGO_PKG_VERSION")));
    if env::var_os("OTEL_SERVICE_NAME").is_none() {
        resource = resource.with_service_name("darn");
    }
    let provider = SdkTracerProvider::builder()
        .with_batch_exporter(exporter)
        .with_resource(resource.build())
        .build();
    global::set_tracer_provider(provider.clone());
    Ok(Some(TraceGuard(provider)))
}

/// The span of a request, below that of its caller where the headers name one.
pub fn request_span(headers: &HeaderMap, method: &str, route: &str) -> Context {
    let parent =
        TraceContextPropagator::new().extract_with_context(&Context::new(), &Headers(headers));
    let builder = SpanBuilder::from_name(format!("{method} {route}"))
        .with_kind(SpanKind::Server)
        .with_attributes([
            KeyValue::new("http.request.method", method.to_owned()),
            KeyValue::new("http.route", route.to_owned()),
        ]);
    started(builder, &parent)
}

/// Ends the span of a request.
pub fn end_request(context: &Context, status: u16, code: Option<&'static str>) {
    let span = context.span();
    span.set_attribute(KeyValue::new(
        "http.response.status_code",
        i64::from(status),
    ));
    if let Some(code) = code {
        span.set_attribute(KeyValue::new("error.type", code));
    }
    if status >= 500 {
        span.set_status(Status::error(code.unwrap_or_default()));
    }
    span.end();
}

/// The span of an attempt at a job: a trace of its own, with a link to the request that handed the job over.
pub fn job_span(job: &str, attempt: i64, handed_over: Option<&str>) -> Context {
    let link = handed_over.and_then(span_of).map(Link::with_context);
    let builder = SpanBuilder::from_name("job")
        .with_kind(SpanKind::Consumer)
        .with_links(link.into_iter().collect())
        .with_attributes([
            KeyValue::new("darn.job.id", job.to_owned()),
            KeyValue::new("darn.job.attempt", attempt),
        ]);
    started(builder, &Context::new())
}

/// Notes in the present span why its work failed.
pub fn note_failure(code: &'static str) {
    let context = Context::current();
    context
        .span()
        .set_attribute(KeyValue::new("error.type", code));
    context.span().set_status(Status::error(code));
}

/// The present span as a value of `traceparent`; `None` where nothing is traced.
pub fn current_parent() -> Option<String> {
    let context = Context::current();
    let span = context.span().span_context().clone();
    span.is_valid().then(|| {
        let flags = span.trace_flags() & TraceFlags::SAMPLED;
        format!(
            "00-{}-{}-{:02x}",
            span.trace_id(),
            span.span_id(),
            flags.to_u8()
        )
    })
}

/// The present trace's id; `None` where nothing is traced.
pub fn trace_id(context: &Context) -> Option<String> {
    let span = context.span();
    let span = span.span_context();
    span.is_valid().then(|| span.trace_id().to_string())
}

/// A span below the present one for time that has just passed.
pub fn past_span(name: &'static str, took: Duration) {
    let now = SystemTime::now();
    let begun = now.checked_sub(took).unwrap_or(now);
    add_past(name, begun, now);
}

/// Spans below the present one for the stages of a mend that has just ended, one after another, as long as the report says.
pub fn stage_spans(report: &v1::Report) {
    let Some(timings) = report
        .timings
        .filter(|_| Context::current().span().is_recording())
    else {
        return;
    };
    let stages = [
        ("read", timings.read),
        ("weld", timings.weld),
        ("loops", timings.loops),
        ("holes", timings.holes),
        ("texture", timings.texture),
        ("write", timings.write),
    ];
    let lengths = stages.map(|(name, ms)| {
        (
            name,
            Duration::try_from_secs_f64(ms / 1e3).unwrap_or_default(),
        )
    });
    let total: Duration = lengths.iter().map(|(_, length)| *length).sum();
    let now = SystemTime::now();
    let mut begun = now.checked_sub(total).unwrap_or(now);
    for (name, length) in lengths {
        let end = begun + length;
        add_past(name, begun, end);
        begun = end;
    }
    let context = Context::current();
    let holes = i64::try_from(report.holes.len()).unwrap_or(i64::MAX);
    context
        .span()
        .set_attribute(KeyValue::new("darn.holes.filled", holes));
}

fn add_past(name: &'static str, begun: SystemTime, ended: SystemTime) {
    let context = Context::current();
    if !context.span().is_recording() {
        return;
    }
    let builder = SpanBuilder::from_name(name).with_start_time(begun);
    started(builder, &context).span().end_with_timestamp(ended);
}

fn started(builder: SpanBuilder, parent: &Context) -> Context {
    let tracer = global::tracer(SCOPE);
    parent.with_span(tracer.build_with_context(builder, parent))
}

fn span_of(trace_parent: &str) -> Option<SpanContext> {
    let mut headers = HeaderMap::new();
    headers.insert(TRACE_PARENT, trace_parent.try_into().ok()?);
    let context =
        TraceContextPropagator::new().extract_with_context(&Context::new(), &Headers(&headers));
    let span = context.span().span_context().clone();
    span.is_valid().then_some(span)
}

/// Headers as the propagator reads them.
struct Headers<'a>(&'a HeaderMap);

impl Extractor for Headers<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.to_str().ok()
    }

    fn keys(&self) -> Vec<&str> {
        self.0.keys().map(|name| name.as_str()).collect()
    }
}
