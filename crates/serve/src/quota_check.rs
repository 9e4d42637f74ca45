//! The quotas of keys at the door: requests and bodies are counted, and every answer says what is left
//! (draft-ietf-httpapi-ratelimit-headers-10).

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Instant,
};

use axum::{
    body::{Body, HttpBody},
    extract::Request,
    http::{HeaderMap, HeaderName, HeaderValue},
};
use bytes::Bytes;
use hyper::body::{Frame, SizeHint};

use super::{
    keys::Key,
    quota::{Exceeded, Quota, Remainder},
};

/// What is left of each quota.
pub const RATELIMIT: HeaderName = HeaderName::from_static("ratelimit");
/// The quotas.
pub const RATELIMIT_POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");

/// Counts a request and the body that it declares; its body is counted further as it comes.
///
/// # Errors
/// A quota of the key leaves no room for it.
pub fn admit(key: &Arc<Key>, request: &mut Request) -> Result<(), Exceeded> {
    let now = Instant::now();
    key.usage.take_request(&key.limits, now)?;
    let length = request.body().size_hint().exact();
    if length == Some(0) || key.limits.bytes_per_day.is_none() {
        return Ok(());
    }
    key.usage.take_bytes(&key.limits, length, now)?;
    let metered = MeteredBody {
        body: std::mem::take(request.body_mut()),
        key: Arc::clone(key),
        declared: length.unwrap_or(0),
    };
    *request.body_mut() = Body::new(metered);
    Ok(())
}

/// Says in an answer what is left of a key's quotas, and which one refused the request.
pub fn tell(key: &Key, exceeded: Option<&Exceeded>, headers: &mut HeaderMap) {
    let mut all = key.usage.remainders(&key.limits, Instant::now());
    if let Some(Exceeded {
        quota,
        limit,
        retry_after,
    }) = exceeded
    {
        match all.iter_mut().find(|of| of.quota == *quota) {
            // The same wait as in `retry-after`, though a moment has passed.
            Some(of) if of.left == 0 => of.wait = *retry_after,
            Some(_) => {}
            None => all.push(Remainder {
                quota: *quota,
                limit: *limit,
                left: 0,
                wait: *retry_after,
            }),
        }
    }
    if all.is_empty() {
        return;
    }
    let list = |item: fn(&Remainder) -> String| {
        let items: Vec<String> = all.iter().map(item).collect();
        HeaderValue::from_str(&items.join(", "))
    };
    if let (Ok(policy), Ok(left)) = (list(policy), list(left)) {
        headers.insert(RATELIMIT_POLICY, policy);
        headers.insert(RATELIMIT, left);
    }
}

/// An item of `RateLimit-Policy`.
fn policy(of: &Remainder) -> String {
    let unit = match of.quota {
        Quota::Bytes => ";qu=\"content-bytes\"",
        Quota::Requests | Quota::WaitingJobs | Quota::Sessions => "",
    };
    let window = of.quota.window();
    let window = window.map_or_else(String::new, |window| format!(";w={}", window.as_secs()));
    format!("\"{}\";q={}{unit}{window}", of.quota.name(), of.limit)
}

/// An item of `RateLimit`.
fn left(of: &Remainder) -> String {
    let wait = of
        .wait
        .map_or_else(String::new, |wait| format!(";t={wait}"));
    format!("\"{}\";r={}{wait}", of.quota.name(), of.left)
}

/// A body whose bytes are counted as those of a key.
struct MeteredBody {
    body: Body,
    key: Arc<Key>,
    /// Bytes that it has declared, that are taken, and that have not come.
    declared: u64,
}

impl MeteredBody {
    fn count(&mut self, bytes: usize) {
        let bytes = bytes as u64;
        let declared = bytes.min(self.declared);
        self.declared -= declared;
        if bytes > declared {
            let Key { usage, limits, .. } = &*self.key;
            usage.charge_bytes(limits, bytes - declared, Instant::now());
        }
    }
}

impl Drop for MeteredBody {
    fn drop(&mut self) {
        if self.declared > 0 {
            let Key { usage, limits, .. } = &*self.key;
            usage.give_back_bytes(limits, self.declared, Instant::now());
        }
    }
}

impl HttpBody for MeteredBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(cx));
        if let Some(Ok(frame)) = &frame
            && let Some(data) = frame.data_ref()
        {
            self.count(data.len());
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
