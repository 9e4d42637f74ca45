//! What a client asks for when it hands over a scan as a job, and how that is kept with the job.

use axum::http::{HeaderMap, HeaderName};
use darn_jobs::Submission;
use serde::{Deserialize, Serialize};

use super::{
    app::App,
    client::Caller,
    error::{ParameterKind, RequestError},
    parameters::Parameters,
    response, traces,
};
use darn_contract::{Constraints, FieldError, excerpt, from_json, port::ScanForm, v1};

/// The client's key: a repeated request with it is answered with the first one's job.
pub const IDEMPOTENCY_KEY: HeaderName = HeaderName::from_static("idempotency-key");

/// Most bytes of a key: a database's index takes no more than some 2,000.
const MAX_KEY_BYTES: usize = 255;
/// Most characters of a job's name.
const MAX_NAME_CHARACTERS: usize = 200;
/// The largest priority, and the negative of the least one.
const MAX_PRIORITY: i64 = 100;

/// Constraints that have passed the check, as the message that is kept.
#[derive(Debug)]
pub struct KeptConstraints(v1::Constraints);

impl Parameters for KeptConstraints {
    const KIND: ParameterKind = ParameterKind::Constraints;
    const PART: &'static str = "constraints";
    type Message = v1::Constraints;

    fn check_message(message: &v1::Constraints) -> Result<Self, Vec<FieldError>> {
        Constraints::check(message).map(|_| Self(message.clone()))
    }
}

/// What is asked, as it is kept with the job.
#[derive(Debug, Serialize, Deserialize)]
pub struct JobRequest {
    /// The constraints as JSON; none are left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    constraints: Option<String>,
    /// The form in which the mended scan goes back.
    form: KeptForm,
}

/// [`ScanForm`] as it is kept.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum KeptForm {
    AsReceived,
    Gltf,
    Glb,
}

impl JobRequest {
    /// A request for a mend under constraints, in a form.
    pub fn new(constraints: Option<KeptConstraints>, form: ScanForm) -> Self {
        let text = |it: KeptConstraints| String::from_utf8(response::json(&it.0)).ok();
        Self {
            constraints: constraints.and_then(text),
            form: match form {
                ScanForm::AsReceived => KeptForm::AsReceived,
                ScanForm::Gltf => KeptForm::Gltf,
                ScanForm::Glb => KeptForm::Glb,
            },
        }
    }

    /// The text that is kept.
    pub fn text(&self) -> String {
        String::from_utf8(response::json(self)).unwrap_or_default()
    }

    /// Reads the text that is kept; `None` for one that this version cannot read.
    pub fn read(text: &str) -> Option<Self> {
        serde_json::from_str(text).ok()
    }

    /// The constraints, checked again: another version of darn may have taken them.
    ///
    /// # Errors
    /// `Malformed` or `Invalid`.
    pub fn constraints(&self) -> Result<Constraints, RequestError> {
        let Some(text) = &self.constraints else {
            return Ok(Constraints::default());
        };
        let message = from_json(text.as_bytes())
            .map_err(|error| RequestError::of_json(ParameterKind::Constraints, error))?;
        Constraints::from_message(&message)
    }

    /// The form in which the mended scan goes back.
    pub fn form(&self) -> ScanForm {
        match self.form {
            KeptForm::AsReceived => ScanForm::AsReceived,
            KeptForm::Gltf => ScanForm::Gltf,
            KeptForm::Glb => ScanForm::Glb,
        }
    }
}

/// What a request says about its job beside the scan: its key, and from the URL's query its name, its priority and its webhook.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct JobLabels {
    key: Option<String>,
    name: Option<String>,
    priority: i64,
    webhook: Option<String>,
}

impl JobLabels {
    /// The key alone.
    ///
    /// # Errors
    /// `Malformed`.
    pub fn of_headers(headers: &HeaderMap) -> Result<Self, RequestError> {
        let mut keys = headers.get_all(IDEMPOTENCY_KEY).iter();
        let key = match (keys.next(), keys.next()) {
            (None, _) => None,
            (Some(key), None) => Some(checked_key(key.to_str().unwrap_or_default())?),
            (Some(_), Some(_)) => {
                return Err(malformed("the header `idempotency-key` comes twice"));
            }
        };
        Ok(Self {
            key,
            ..Self::default()
        })
    }

    /// The key, and what the URL's query says.
    ///
    /// # Errors
    /// `Malformed`.
    pub fn of(headers: &HeaderMap, query: Option<&str>) -> Result<Self, RequestError> {
        let mut labels = Self::of_headers(headers)?;
        for (name, value) in form_urlencoded::parse(query.unwrap_or_default().as_bytes()) {
            match name.as_ref() {
                "name" => labels.name = Some(checked_name(&value)?),
                "priority" => labels.priority = checked_priority(&value)?,
                "webhook" => labels.webhook = Some(value.into_owned()),
                other => {
                    return Err(malformed(&format!(
                        "`{}` is not known; the URL's query has `name`, `priority` and `webhook`",
                        excerpt(other)
                    )));
                }
            }
        }
        Ok(labels)
    }

    /// What a gRPC call says.
    ///
    /// # Errors
    /// `Malformed`.
    pub fn of_message(message: v1::JobLabels) -> Result<Self, RequestError> {
        let key = message.idempotency_key.as_deref().map(checked_key);
        let name = message.name.as_deref().map(checked_name);
        Ok(Self {
            key: key.transpose()?,
            name: name.transpose()?,
            priority: in_range(message.priority.into())?,
            webhook: message.webhook,
        })
    }

    /// The client's key.
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }

    /// Checks where the webhook may go, and that its requests can be signed.
    ///
    /// # Errors
    /// `Malformed` or `WebhooksOff`.
    pub fn checked(self, app: &App, caller: &Caller) -> Result<Self, RequestError> {
        let webhook = match (&self.webhook, &app.webhooks) {
            (Some(text), Some(webhooks)) => Some(webhooks.check(text, caller.key.as_ref())?),
            // Without webhooks there are no jobs, which is said.
            _ => None,
        };
        Ok(Self { webhook, ..self })
    }

    /// A submission of the client whose jobs are kept under this text.
    pub fn submission(self, owner: String, request: &JobRequest) -> Submission {
        Submission {
            client: owner,
            idempotency_key: self.key,
            name: self.name,
            priority: self.priority,
            webhook: self.webhook,
            trace: traces::current_parent(),
            request: request.text(),
        }
    }
}

fn checked_key(key: &str) -> Result<String, RequestError> {
    let is_plain = key.bytes().all(|byte| byte.is_ascii_graphic());
    if !is_plain || !(1..=MAX_KEY_BYTES).contains(&key.len()) {
        return Err(malformed(&format!(
            "the idempotency key must have 1 to {MAX_KEY_BYTES} visible ASCII characters"
        )));
    }
    Ok(key.to_owned())
}

fn checked_name(name: &str) -> Result<String, RequestError> {
    if name.chars().count() > MAX_NAME_CHARACTERS || name.chars().any(char::is_control) {
        return Err(malformed(&format!(
            "`name` must have at most {MAX_NAME_CHARACTERS} characters and no control characters"
        )));
    }
    Ok(name.to_owned())
}

fn checked_priority(text: &str) -> Result<i64, RequestError> {
    // What is no number is out of range, too.
    in_range(text.parse().unwrap_or(i64::MAX))
}

fn in_range(priority: i64) -> Result<i64, RequestError> {
    if (-MAX_PRIORITY..=MAX_PRIORITY).contains(&priority) {
        Ok(priority)
    } else {
        Err(malformed(&format!(
            "`priority` must be a whole number from -{MAX_PRIORITY} to {MAX_PRIORITY}"
        )))
    }
}

fn malformed(detail: &str) -> RequestError {
    RequestError::Malformed(detail.to_owned())
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[test]
    fn labels_are_checked() {
        let headers = |keys: &[&str]| {
            let mut headers = HeaderMap::new();
            for key in keys {
                headers.append(IDEMPOTENCY_KEY, HeaderValue::from_str(key).unwrap());
            }
            headers
        };
        let query = "name=Coat%20no.%207+left&priority=-3";
        let labels = JobLabels::of(&headers(&["a-1"]), Some(query)).unwrap();
        assert_eq!(labels.key.as_deref(), Some("a-1"));
        assert_eq!(labels.name.as_deref(), Some("Coat no. 7 left"));
        assert_eq!(labels.priority, -3);
        let long = "k".repeat(256);
        for (keys, query) in [
            (vec!["a", "b"], ""),
            (vec![""], ""),
            (vec!["two words"], ""),
            (vec![long.as_str()], ""),
            (vec![], "name=%00"),
            (vec![], "priority=101"),
            (vec![], "priority=high"),
            (vec![], "colour=red"),
        ] {
            let refused = JobLabels::of(&headers(&keys), Some(query)).unwrap_err();
            assert_eq!(refused.code().status, 400, "{keys:?} {query}");
        }
    }

    #[test]
    fn labels_of_calls_are_those_of_requests() {
        let good = v1::JobLabels {
            name: Some("Coat no. 7 left".to_owned()),
            priority: -3,
            webhook: None,
            idempotency_key: Some("a-1".to_owned()),
        };
        let mut headers = HeaderMap::new();
        headers.insert(IDEMPOTENCY_KEY, HeaderValue::from_static("a-1"));
        let query = "name=Coat%20no.%207+left&priority=-3";
        assert_eq!(
            JobLabels::of_message(good.clone()).unwrap(),
            JobLabels::of(&headers, Some(query)).unwrap()
        );
        for bad in [
            v1::JobLabels {
                name: Some("\0".to_owned()),
                ..good.clone()
            },
            v1::JobLabels {
                priority: 101,
                ..good.clone()
            },
            v1::JobLabels {
                idempotency_key: Some(String::new()),
                ..good
            },
        ] {
            let refused = JobLabels::of_message(bad).unwrap_err();
            assert_eq!(refused.code().status, 400);
        }
    }

    #[test]
    fn constraints_are_kept_as_they_came() {
        let text = br#"{"anchors": [{"position": [0.1, 1e-300, 3]}], "except": [2], "up": [0, 1, 0], "holes": [{"border": "auto"}]}"#;
        let kept = KeptConstraints::parse(text).unwrap();
        let request = JobRequest::new(Some(kept), ScanForm::Glb);
        let read = JobRequest::read(&request.text()).unwrap();
        assert_eq!(
            read.constraints().unwrap(),
            Constraints::parse(text).unwrap()
        );
        assert_eq!(read.form(), ScanForm::Glb);
    }
}
