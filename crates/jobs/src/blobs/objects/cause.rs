//! Why the storage did not do what it was asked, in few words: the library's errors quote whole answers, and those quote what was signed.

use std::{error::Error, io};

/// The codes of a storage that is full: MinIO's, and those of a quota.
const FULL: [&str; 3] = ["XMinioStorageFull", "QuotaExceeded", "InsufficientStorage"];

/// The error's kind and cause, without anything of credentials.
///
/// The kind is `NotConnected` where the storage cannot be reached or takes no work now, `NotFound` where the object is missing, not where the bucket is.
pub(super) fn cause(error: &object_store::Error) -> io::Error {
    let text = error.to_string();
    let code = between(&text, "<Code>", "</Code>");
    let status = between(&text, "status code: ", ":");
    let kind = match (error, code) {
        (_, Some(code)) if FULL.contains(&code) => io::ErrorKind::StorageFull,
        _ if status.is_some_and(|status| status.starts_with("507")) => io::ErrorKind::StorageFull,
        (_, Some("NoSuchBucket")) => io::ErrorKind::Other,
        (object_store::Error::NotFound { .. }, _) => io::ErrorKind::NotFound,
        (object_store::Error::PermissionDenied { .. }, _)
        | (object_store::Error::Unauthenticated { .. }, _) => io::ErrorKind::PermissionDenied,
        // Without a status nothing was answered.
        _ if status.is_none_or(is_busy) => io::ErrorKind::NotConnected,
        _ => io::ErrorKind::Other,
    };
    let said = match (code, between(&text, "<Message>", "</Message>"), status) {
        (Some(code), Some(message), _) => format!("{code} ({message})"),
        (Some(code), None, _) => code.to_owned(),
        (None, _, Some(status)) => format!("it answers with {status}"),
        (None, _, None) => root(error),
    };
    let said = match server(&text) {
        Some(server) => format!("{said}, from {server}"),
        None => said,
    };
    io::Error::new(kind, said)
}

/// Whether an answer with this status may be another one later.
fn is_busy(status: &str) -> bool {
    status.starts_with('5') || status.starts_with("429")
}

/// The last cause: what the system, TLS or the settings say.
fn root(error: &object_store::Error) -> String {
    let mut cause: &dyn Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
}

/// Scheme, host and port of the URL that was asked.
fn server(text: &str) -> Option<String> {
    let start = text.find("http://").or_else(|| text.find("https://"))?;
    let (scheme, rest) = text[start..].split_once("://")?;
    let host = rest.split(['/', '?', ' ', ')', '"']).next()?;
    // What stands before an `@` may be a password.
    let host = host.rsplit_once('@').map_or(host, |(_, host)| host);
    Some(format!("{scheme}://{host}"))
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(before)?;
    rest.split_once(after).map(|(found, _)| found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(text: &str) -> io::Error {
        cause(&object_store::Error::Generic {
            store: "S3",
            source: text.to_owned().into(),
        })
    }

    #[test]
    fn what_was_signed_is_not_repeated() {
        let error = said(
            "Error performing PUT http://me:hush@s3.example.org:9000/scans/a?x=1 in 1ms - Server returned non-2xx status code: 403 Forbidden: \
             <Error><Code>SignatureDoesNotMatch</Code><Message>The signature differs.</Message><AWSAccessKeyId>AKHUSH</AWSAccessKeyId></Error>",
        );
        assert_eq!(
            error.to_string(),
            "SignatureDoesNotMatch (The signature differs.), from http://s3.example.org:9000"
        );
    }

    #[test]
    fn a_full_storage_is_told_apart() {
        let full = "Server returned non-2xx status code: 507 Insufficient Storage: ";
        assert_eq!(said(full).kind(), io::ErrorKind::StorageFull);
        let full = "status code: 403 Forbidden: <Code>QuotaExceeded</Code>";
        assert_eq!(said(full).kind(), io::ErrorKind::StorageFull);
        let down = said("status code: 503 Service Unavailable: ");
        assert_eq!(
            (down.kind(), down.to_string().as_str()),
            (
                io::ErrorKind::NotConnected,
                "it answers with 503 Service Unavailable"
            )
        );
        let wrong = said("status code: 400 Bad Request: <Code>InvalidArgument</Code>");
        assert_eq!(wrong.kind(), io::ErrorKind::Other);
        assert_eq!(
            said("tcp connect error").kind(),
            io::ErrorKind::NotConnected
        );
    }
}
