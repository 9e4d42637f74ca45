//! Jobs over gRPC: what `/jobs` is over HTTP.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
};

use bytes::Bytes;
use darn_jobs::{Jobs, ListQuery, State, blobs::BlobFile};
use tokio::io::{AsyncRead as _, AsyncReadExt as _, ReadBuf};
use tonic::{
    Request, Response, Status, Streaming,
    codegen::tokio_stream::{Stream, wrappers::ReceiverStream},
};
use tracing::error;

use super::{
    answer::LiveAnswer,
    app::App,
    client::Caller,
    error::RequestError,
    generated::jobs_server::{self, JobsServer},
    grpc::request_id,
    grpc_chunks::{CHUNK_BYTES, Chunks, MAX_MESSAGE_BYTES},
    job_events::{self, Listener},
    job_input::Inlet,
    job_message::message,
    job_request::{JobLabels, JobRequest, KeptConstraints},
    job_routes::{DEFAULT_LIMIT, KnownJob, MAX_LIMIT, page},
    job_upload::{Pieces, take_pieces},
    key_file::Scope,
    parameters::Parameters,
    uploads::BodySize,
};
use darn_contract::port::ScanForm;
use darn_contract::{from_json, v1};

/// The service, ready to be routed.
pub fn service(app: &Arc<App>) -> JobsServer<GrpcJobs> {
    JobsServer::new(GrpcJobs(Arc::clone(app)))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(usize::MAX)
}

/// Answers calls for jobs.
#[derive(Debug)]
pub struct GrpcJobs(Arc<App>);

/// The answer of a call.
type Answer<T> = Result<Response<T>, Status>;

/// Says an error of a call in the words of gRPC.
fn answer<T>(id: String, done: Result<T, RequestError>) -> Answer<T> {
    done.map(Response::new).map_err(|error| error.grpc(&id))
}

#[tonic::async_trait]
impl jobs_server::Jobs for GrpcJobs {
    type ResultStream = FileChunks;
    type EventsStream = ReceiverStream<Result<v1::Job, Status>>;

    async fn submit(&self, request: Request<Streaming<v1::JobChunk>>) -> Answer<v1::Job> {
        answer(request_id(&request), self.hand_over(request).await)
    }

    async fn get(&self, request: Request<v1::JobId>) -> Answer<v1::Job> {
        let described = async {
            let known = self.known(&request, &request.get_ref().id).await?;
            Ok(message(&known.jobs, &known.job).await?)
        };
        answer(request_id(&request), described.await)
    }

    async fn list(&self, request: Request<v1::JobQuery>) -> Answer<v1::JobList> {
        let listed = async {
            let query = list_query(request.get_ref())?;
            page(self.jobs()?, &Caller::of(request.extensions()), query).await
        };
        answer(request_id(&request), listed.await)
    }

    async fn result(&self, request: Request<v1::JobId>) -> Answer<FileChunks> {
        let opened = async {
            let KnownJob { jobs, job } = self.known(&request, &request.get_ref().id).await?;
            FileChunks::of_result(&jobs, job.id).await
        };
        answer(request_id(&request), opened.await)
    }

    async fn report(&self, request: Request<v1::JobId>) -> Answer<v1::Report> {
        let read = async {
            let KnownJob { jobs, job } = self.known(&request, &request.get_ref().id).await?;
            report(&jobs, job.id).await
        };
        answer(request_id(&request), read.await)
    }

    async fn events(&self, request: Request<v1::JobEventsQuery>) -> Answer<Self::EventsStream> {
        let events = async {
            let v1::JobEventsQuery { id, last_version } = request.get_ref();
            let KnownJob { jobs, job } = self.known(&request, id).await?;
            // Versions start at 1: whoever has seen none is told the present one.
            let seen = i64::from(last_version.unwrap_or(0));
            if job.state.is_finished() && seen == job.version {
                let (_, ended) = tokio::sync::mpsc::channel(1);
                return Ok(ended);
            }
            let listener = Listener {
                app: Arc::clone(&self.0),
                jobs,
                caller: Caller::of(request.extensions()),
            };
            Ok(job_events::listen(listener, job.id, seen, |job| {
                job.cloned().map(Ok)
            }))
        };
        let mut answer = answer(request_id(&request), events.await)?.map(ReceiverStream::new);
        answer.extensions_mut().insert(LiveAnswer);
        Ok(answer)
    }

    async fn cancel(&self, request: Request<v1::JobId>) -> Answer<v1::Job> {
        let cancelled = async {
            let known = self.known(&request, &request.get_ref().id).await?;
            known.cancel().await
        };
        answer(request_id(&request), cancelled.await)
    }

    async fn retry(&self, request: Request<v1::JobId>) -> Answer<v1::Job> {
        let retried = async {
            let known = self.known(&request, &request.get_ref().id).await?;
            known.retry(&Caller::of(request.extensions())).await
        };
        answer(request_id(&request), retried.await)
    }

    async fn delete(&self, request: Request<v1::JobId>) -> Answer<v1::JobDeleted> {
        let deleted = async {
            let KnownJob { jobs, job } = self.known(&request, &request.get_ref().id).await?;
            jobs.delete(job.id).await?;
            Ok(v1::JobDeleted {})
        };
        answer(request_id(&request), deleted.await)
    }
}

impl GrpcJobs {
    fn jobs(&self) -> Result<&Arc<Jobs>, RequestError> {
        self.0.jobs.as_ref().ok_or(RequestError::JobsNotKept)
    }

    /// The job of an id, which the caller may see.
    async fn known<T>(&self, request: &Request<T>, id: &str) -> Result<KnownJob, RequestError> {
        KnownJob::find(&self.0, &Caller::of(request.extensions()), id).await
    }

    async fn hand_over(
        &self,
        request: Request<Streaming<v1::JobChunk>>,
    ) -> Result<v1::Job, RequestError> {
        let app = &self.0;
        let caller = Caller::of(request.extensions());
        if !caller.may_hand_over() {
            return Err(RequestError::InsufficientScope { scope: Scope::Jobs });
        }
        let jobs = self.jobs()?;
        let upload = app.upload_slot_for(BodySize::Large, app.client(&caller))?;
        let mut pieces = JobChunks {
            chunks: Chunks::new(app, request.into_inner()),
            app,
            caller: &caller,
            labels: JobLabels::default(),
            constraints: None,
            first: None,
        };
        // The labels come with it.
        pieces.first = (&mut pieces).next().await?;
        let inlet = Inlet::open(app, jobs, &caller, &pieces.labels).await?;
        let input = take_pieces(inlet, &mut pieces).await?;
        if input.bytes() == 0 {
            return Err(RequestError::EmptyBody);
        }
        let asked = JobRequest::new(pieces.constraints, ScanForm::AsReceived);
        let submission = pieces.labels.submission(app.job_owner(&caller), &asked);
        let job = input.submit(jobs, &caller, submission).await?;
        drop(upload);
        Ok(message(jobs, &job).await?)
    }
}

/// The chunks of a job that is handed over.
struct JobChunks<'a> {
    chunks: Chunks<v1::JobChunk>,
    app: &'a App,
    caller: &'a Caller,
    labels: JobLabels,
    constraints: Option<KeptConstraints>,
    /// The data of the first chunk, while it was looked at and not handed on.
    first: Option<Bytes>,
}

impl Pieces for &mut JobChunks<'_> {
    async fn next(&mut self) -> Result<Option<Bytes>, RequestError> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        let Some((chunk, place)) = self.chunks.next().await? else {
            return Ok(None);
        };
        if let Some(message) = chunk.labels {
            place.check_first("labels")?;
            self.labels = JobLabels::of_message(message)?.checked(self.app, self.caller)?;
        }
        if let Some(message) = chunk.constraints {
            place.check_first("constraints")?;
            self.constraints = Some(KeptConstraints::from_message(&message)?);
        }
        Ok(Some(chunk.data))
    }
}

fn list_query(message: &v1::JobQuery) -> Result<ListQuery, RequestError> {
    let wrong = |detail: String| RequestError::Malformed(detail);
    let state = match message.state.map(v1::JobState::try_from) {
        None => None,
        Some(Ok(v1::JobState::Waiting)) => Some(State::Waiting),
        Some(Ok(v1::JobState::Running)) => Some(State::Running),
        Some(Ok(v1::JobState::Done)) => Some(State::Done),
        Some(Ok(v1::JobState::Error)) => Some(State::Error),
        Some(Ok(v1::JobState::Cancelled)) => Some(State::Cancelled),
        Some(Ok(v1::JobState::Unspecified) | Err(_)) => {
            return Err(wrong("`state` is no state of a job".to_owned()));
        }
    };
    let before = message.from.as_deref().map(str::parse).transpose();
    let limit = message.limit.unwrap_or(DEFAULT_LIMIT);
    if !(1..=MAX_LIMIT).contains(&limit) {
        return Err(wrong(format!(
            "`limit` must be a whole number from 1 to {MAX_LIMIT}"
        )));
    }
    Ok(ListQuery {
        client: None,
        state,
        before: before
            .map_err(|_| wrong("`from` must be the `next` of another page".to_owned()))?,
        limit,
    })
}

/// The report of a job that is done.
async fn report(jobs: &Jobs, id: uuid::Uuid) -> Result<v1::Report, RequestError> {
    let (_, mut file) = jobs.report(id).await?;
    let mut text = Vec::new();
    let read = file.read_to_end(&mut text).await;
    read.map_err(|error| unreadable(&error))?;
    from_json(&text).map_err(|fault| {
        error!(job = %id, ?fault, "the report of a job cannot be read");
        RequestError::Internal
    })
}

fn unreadable(error: &std::io::Error) -> RequestError {
    error!(%error, "a file of a job cannot be read");
    RequestError::Internal
}

/// The result of a job as it is read: first its report, then the bytes of the scan.
#[derive(Debug)]
pub struct FileChunks {
    /// Until it is sent.
    report: Option<v1::Report>,
    file: BlobFile,
    piece: Vec<u8>,
}

impl FileChunks {
    /// That of a job.
    ///
    /// # Errors
    /// `JobUnfinished`, `JobWrongState` or `JobExpired`.
    pub async fn of_result(jobs: &Jobs, job: uuid::Uuid) -> Result<Self, RequestError> {
        let (_, file) = jobs.result(job).await?;
        Ok(Self {
            report: Some(report(jobs, job).await?),
            file,
            piece: vec![0; CHUNK_BYTES],
        })
    }
}

impl Stream for FileChunks {
    type Item = Result<v1::InpaintChunk, Status>;

    fn poll_next(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let chunk = |part| v1::InpaintChunk { part: Some(part) };
        if let Some(report) = self.report.take() {
            return Poll::Ready(Some(Ok(chunk(v1::inpaint_chunk::Part::Report(report)))));
        }
        let Self { file, piece, .. } = &mut *self;
        let mut buffer = ReadBuf::new(piece);
        if let Err(error) = ready!(Pin::new(file).poll_read(cx, &mut buffer)) {
            return Poll::Ready(Some(Err(unreadable(&error).grpc(""))));
        }
        let read = buffer.filled();
        if read.is_empty() {
            return Poll::Ready(None);
        }
        let data = read.to_vec().into();
        Poll::Ready(Some(Ok(chunk(v1::inpaint_chunk::Part::Data(data)))))
    }
}
