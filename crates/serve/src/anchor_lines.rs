//! The answer of an anchor search whose map comes as it is computed: JSON messages, one a line.
//!
//! Each piece of the map is a task of its own, so that other requests to the session go between them. While the cloth is dragged the map waits. It ends
//! when the client closes the request.

use std::{sync::Arc, time::Duration};

use axum::{
    body::Body,
    http::header,
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use tokio::{select, sync::mpsc, time::sleep};
use uuid::Uuid;

use super::{
    answer::LiveAnswer,
    app::{App, UploadPermit},
    client::Client,
    error::RequestError,
    job_events::{EventBody, NO_BUFFERING},
    media_types::NDJSON,
    response,
    uploads::BodySize,
};
use darn_contract::port::MapSpan;
use darn_contract::{Search, v1, v1::anchor_line::Line};

/// Cells of a piece, a forward pass each: what an edit that comes meanwhile waits for at most.
const PIECE_CELLS: usize = 8;
/// How long after an edit the map waits for another one.
const QUIET: Duration = Duration::from_millis(250);
/// How long a piece waits before it is tried again, where edits or other requests go first.
const PAUSE: Duration = Duration::from_millis(50);
/// Lines that wait for a client that reads slowly; then the map waits.
const LINES_AHEAD: usize = 4;

/// A search on a session.
pub struct Searched {
    /// The service.
    pub app: Arc<App>,
    /// Whoever asked.
    pub client: Client,
    /// The session.
    pub id: Uuid,
    /// What is searched.
    pub search: Search,
}

/// Where the point belongs, then its map if the search asks for one.
///
/// # Errors
/// Those of the search without a map; what goes wrong later is the last line.
pub async fn answer(searched: Searched, upload: UploadPermit) -> Result<Response, RequestError> {
    let search = Search {
        map: false,
        ..searched.search
    };
    let found = (searched.app).submit_to_session(searched.id, upload, move |session, budget| {
        session.optimize_anchor(&search, budget)
    });
    let first = line(Line::Found(found.await?));
    let (lines, received) = mpsc::channel(LINES_AHEAD);
    tokio::spawn(async move {
        select! {
            () = tell(&searched, first, &lines) => {}
            () = lines.closed() => {}
            () = searched.app.stopping.cancelled() => {}
        }
    });
    let headers = [
        (header::CONTENT_TYPE, NDJSON),
        (header::CACHE_CONTROL, "no-store"),
        NO_BUFFERING,
    ];
    let mut answer = (headers, Body::new(EventBody { received })).into_response();
    answer.extensions_mut().insert(LiveAnswer);
    Ok(answer)
}

async fn tell(searched: &Searched, first: Bytes, lines: &mpsc::Sender<Bytes>) {
    if lines.send(first).await.is_err() || !searched.search.map {
        return;
    }
    let most = searched.app.limits.deadline;
    let (mut told, mut waited) = (0, Duration::ZERO);
    loop {
        let (error, others_first) = match next_piece(searched, told).await {
            Ok(Some(piece)) => {
                told += piece.cells.len();
                let is_last = piece.cells.is_empty() || told >= piece.total as usize;
                if lines.send(line(Line::Map(piece))).await.is_err() || is_last {
                    return;
                }
                continue;
            }
            Ok(None) => {
                let seconds = most.as_secs_f64();
                (RequestError::Deadline { seconds }, true)
            }
            // Such as a full queue.
            Err(error) => {
                let may_help = error.retry_after().is_some();
                (error, may_help)
            }
        };
        if !others_first || waited > most {
            lines.send(line(problem(&error))).await.ok();
            return;
        }
        waited += PAUSE;
        sleep(PAUSE).await;
    }
}

/// The next cells; `None` while edits go first.
async fn next_piece(
    searched: &Searched,
    first: usize,
) -> Result<Option<v1::MapPiece>, RequestError> {
    let Searched {
        app, client, id, ..
    } = searched;
    let search = searched.search;
    let span = MapSpan {
        first,
        count: PIECE_CELLS,
    };
    let permit = app.upload_permit_for(BodySize::None, client.clone())?;
    app.submit_to_session(*id, permit, move |session, budget| {
        session.map_piece(&search, span, QUIET, budget)
    })
    .await
}

fn problem(error: &RequestError) -> Line {
    let code = error.code();
    let fault = |field: &darn_contract::FieldError| v1::JobFault {
        pointer: field.pointer.clone(),
        detail: field.detail.clone(),
    };
    Line::Problem(v1::JobProblem {
        status: code.status.into(),
        code: code.word.to_owned(),
        detail: error.to_string(),
        errors: error.fields().iter().map(fault).collect(),
    })
}

/// JSON has no line breaks of its own.
fn line(line: Line) -> Bytes {
    let mut text = response::json(&v1::AnchorLine { line: Some(line) });
    text.push(b'\n');
    text.into()
}
