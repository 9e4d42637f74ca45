//! `Inpaint` over gRPC in a process without workers: another one mends the scan as a job, whose result is waited for until the deadline.

use bytes::Bytes;
use darn_jobs::{Job, Jobs, State};
use tonic::{Request, Response, Status, Streaming, metadata::MetadataValue};

use super::{
    app::App,
    client::Caller,
    error::RequestError,
    grpc::{ChunkParameters, request_id, without_others},
    grpc_chunks::{Chunks, insert_result},
    grpc_jobs::FileChunks,
    job_input::Inlet,
    job_message,
    job_request::{JobLabels, JobRequest, KeptConstraints},
    job_routes,
    job_upload::{Pieces, take_pieces},
    parameters::Parameters as _,
    uploads::BodySize,
};
use darn_contract::{port::ScanForm, v1::ScanChunk};

/// Hands a scan over; the answer is the result of its job. Where that takes longer than the deadline, or the service shuts down, the metadata
/// `darn-job` of the error names the job, which goes on.
///
/// # Errors
/// Those of receiving the scan and of the jobs; that of the mend; `DeadlineExceeded` or `Draining`.
pub async fn inpaint_elsewhere(
    app: &App,
    request: Request<Streaming<ScanChunk>>,
) -> Result<Response<FileChunks>, Status> {
    let id = request_id(&request);
    let caller = Caller::of(request.extensions());
    let jobs = app.jobs.as_ref().filter(|_| caller.may_hand_over());
    let jobs = jobs.ok_or_else(|| RequestError::NoWorkers.grpc(&id))?;
    let ended = async {
        let job = hand_over(app, jobs, &caller, request.into_inner()).await?;
        job_routes::finished_within(app, jobs, job, app.limits.deadline).await
    };
    let job = ended.await.map_err(|error| error.grpc(&id))?;
    match job.state {
        State::Waiting | State::Running => Err(unfinished(app, &job, &id)),
        State::Error => Err(job_message::failure(&job).grpc(&id)),
        State::Done | State::Cancelled => {
            let chunks = FileChunks::of_result(jobs, job.id).await;
            let mut response = Response::new(chunks.map_err(|error| error.grpc(&id))?);
            let answer = job_message::kept_answer(&job);
            if let Some(result) = answer.as_ref().and_then(|answer| answer.result()) {
                insert_result(response.metadata_mut(), result);
            }
            Ok(response)
        }
    }
}

async fn hand_over(
    app: &App,
    jobs: &Jobs,
    caller: &Caller,
    stream: Streaming<ScanChunk>,
) -> Result<Job, RequestError> {
    let labels = JobLabels::default();
    let inlet = Inlet::open(app, jobs, caller, &labels).await?;
    let upload = app.upload_slot_for(BodySize::Large, app.client(caller))?;
    let mut pieces = ScanPieces {
        chunks: Chunks::new(app, stream),
        constraints: None,
    };
    let input = take_pieces(inlet, &mut pieces).await?;
    if input.bytes() == 0 {
        return Err(RequestError::EmptyBody);
    }
    let asked = JobRequest::new(pieces.constraints, ScanForm::AsReceived);
    let submission = labels.submission(app.job_owner(caller), &asked);
    let job = input.submit(jobs, caller, submission).await?;
    drop(upload);
    Ok(job)
}

fn unfinished(app: &App, job: &Job, request: &str) -> Status {
    let error = match app.stopping.is_cancelled() {
        true => RequestError::Draining,
        false => RequestError::Deadline {
            seconds: app.limits.deadline.as_secs_f64(),
        },
    };
    let mut status = error.grpc(request);
    if let Ok(id) = MetadataValue::try_from(job.id.to_string()) {
        status.metadata_mut().insert("darn-job", id);
    }
    status
}

/// The chunks of a scan that is handed over.
struct ScanPieces {
    chunks: Chunks<ScanChunk>,
    constraints: Option<KeptConstraints>,
}

impl Pieces for &mut ScanPieces {
    async fn next(&mut self) -> Result<Option<Bytes>, RequestError> {
        let Some((mut chunk, place)) = self.chunks.next().await? else {
            return Ok(None);
        };
        if let Some(message) = KeptConstraints::take(&mut chunk) {
            place.check_first(KeptConstraints::PART)?;
            self.constraints = Some(KeptConstraints::from_message(&message)?);
        }
        without_others(&chunk)?;
        Ok(Some(chunk.data))
    }
}
