//! The gRPC service: the same jobs, limits and errors as over HTTP.

use std::{pin::Pin, sync::Arc};

use tonic::{Request, Response, Status, Streaming, codegen::tokio_stream::Stream};

use super::generated::darn_server::{Darn, DarnServer};
use super::{
    app::App,
    body::ScanRequest,
    client::Caller,
    error::RequestError,
    grpc_chunks::{ChunkStream, MAX_MESSAGE_BYTES, collect, insert_result},
    grpc_handover,
    job_request::KeptConstraints,
    parameters::Parameters,
    scan_files::ScanFiles,
    telemetry::RequestId,
    uploads::BodySize,
};
use darn_contract::port::{HolesQuery, Mended, ScanForm, Stripped};
use darn_contract::{
    Constraints, Outcome, Search,
    v1::{self, AnchorFound, HolesReport, InpaintChunk, ScanChunk, StripChunk},
};

/// The service, ready to be routed. tonic encodes each answer on an async thread; protobuf takes a fraction of JSON's time for it.
pub fn service(app: &Arc<App>) -> DarnServer<GrpcService> {
    DarnServer::new(GrpcService(Arc::clone(app)))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(usize::MAX)
}

/// The chunks of a mended scan, from memory or from the file of a job.
type MendedChunks = Pin<Box<dyn Stream<Item = Result<InpaintChunk, Status>> + Send>>;

/// Answers gRPC calls.
#[derive(Debug)]
pub struct GrpcService(Arc<App>);

#[tonic::async_trait]
impl Darn for GrpcService {
    type InpaintStream = MendedChunks;
    type StripStream = ChunkStream<StripChunk>;

    async fn find_holes(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<HolesReport>, Status> {
        let id = request_id(&request);
        self.holes(request)
            .await
            .map(Response::new)
            .map_err(|error| error.grpc(&id))
    }

    async fn inpaint(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<MendedChunks>, Status> {
        if !self.0.has_workers() {
            let answer = grpc_handover::inpaint_elsewhere(&self.0, request).await?;
            return Ok(answer.map(|chunks| Box::pin(chunks) as MendedChunks));
        }
        let id = request_id(&request);
        let mended = self.mend(request).await.map_err(|error| error.grpc(&id))?;
        let result = Outcome::of(&mended.report).to_string();
        let chunks: MendedChunks = Box::pin(ChunkStream::of_mended(mended));
        let mut response = Response::new(chunks);
        insert_result(response.metadata_mut(), &result);
        Ok(response)
    }

    async fn strip(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<ChunkStream<StripChunk>>, Status> {
        let id = request_id(&request);
        let stripped = (self.stripped(request).await).map_err(|error| error.grpc(&id))?;
        Ok(Response::new(ChunkStream::of_stripped(stripped)))
    }

    async fn optimize_anchor(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<AnchorFound>, Status> {
        let id = request_id(&request);
        self.search(request)
            .await
            .map(Response::new)
            .map_err(|error| error.grpc(&id))
    }
}

impl GrpcService {
    async fn holes(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<HolesReport, RequestError> {
        let ScanRequest {
            scan,
            parameters,
            upload,
            ..
        } = self.receive::<HolesQuery>(request).await?;
        let wanted = parameters.unwrap_or_default();
        self.0
            .submit(upload, scan.len(), move |mender, budget| {
                mender.find_holes(scan, wanted, budget)
            })
            .await
    }

    async fn mend(&self, request: Request<Streaming<ScanChunk>>) -> Result<Mended, RequestError> {
        let ScanRequest {
            scan,
            parameters,
            upload,
            ..
        } = self.receive::<Constraints>(request).await?;
        let constraints = parameters.unwrap_or_default();
        let mended = self
            .0
            .submit(upload, scan.len(), move |mender, budget| {
                mender.inpaint(scan, &constraints, budget)
            })
            .await?;
        self.0.metrics.mended(&mended.report);
        Ok(mended)
    }

    async fn stripped(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Stripped, RequestError> {
        let received = self.receive::<Constraints>(request).await?;
        let ScanRequest { scan, upload, .. } = received.without_constraints()?;
        self.0
            .submit(upload, scan.len(), move |mender, budget| {
                mender.strip(scan, ScanForm::AsReceived, budget)
            })
            .await
    }

    async fn search(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<AnchorFound, RequestError> {
        let ScanRequest {
            scan,
            parameters,
            upload,
            ..
        } = self.receive::<Search>(request).await?;
        let place = "the field `query` of the first chunk";
        let search = parameters.ok_or(RequestError::NoQuery { place })?;
        self.0
            .submit(upload, scan.len(), move |mender, budget| {
                mender.optimize_anchor(scan, &search, budget)
            })
            .await
    }

    /// Reads the chunks of a request.
    async fn receive<P: ChunkParameters>(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<ScanRequest<P>, RequestError> {
        let client = self.0.client(&Caller::of(request.extensions()));
        let stream = request.into_inner();
        let upload = self.0.upload_permit_for(BodySize::Large, client)?;
        let mut parameters = None;
        let scan = collect(&self.0, stream, |chunk: &mut ScanChunk, place| {
            if let Some(message) = P::take(chunk) {
                place.check_first(P::PART)?;
                parameters = Some(P::from_message(&message)?);
            }
            without_others(chunk)
        })
        .await?;
        Ok(ScanRequest {
            files: ScanFiles::of(&scan),
            scan,
            parameters,
            upload,
        })
    }
}

/// Checks a chunk from which the call's own parameters are taken for those of other calls.
///
/// # Errors
/// `Malformed`.
pub fn without_others(chunk: &ScanChunk) -> Result<(), RequestError> {
    if chunk.constraints.is_some() || chunk.query.is_some() || chunk.holes.is_some() {
        return Err(RequestError::Malformed(
            "Inpaint takes `constraints`, OptimizeAnchor `query`, FindHoles `holes`, none of them another's, and Strip none"
                .to_owned(),
        ));
    }
    Ok(())
}

/// Parameters as a field of a chunk.
pub trait ChunkParameters: Parameters {
    /// Takes their message out of a chunk.
    fn take(chunk: &mut ScanChunk) -> Option<Self::Message>;
}

impl ChunkParameters for Constraints {
    fn take(chunk: &mut ScanChunk) -> Option<v1::Constraints> {
        chunk.constraints.take()
    }
}

impl ChunkParameters for KeptConstraints {
    fn take(chunk: &mut ScanChunk) -> Option<v1::Constraints> {
        chunk.constraints.take()
    }
}

impl ChunkParameters for Search {
    fn take(chunk: &mut ScanChunk) -> Option<v1::AnchorQuery> {
        chunk.query.take()
    }
}

impl ChunkParameters for HolesQuery {
    fn take(chunk: &mut ScanChunk) -> Option<v1::HolesQuery> {
        chunk.holes.take()
    }
}

/// The id of a call, for its errors.
pub fn request_id<T>(request: &Request<T>) -> String {
    request
        .extensions()
        .get::<RequestId>()
        .map(|id| id.0.clone())
        .unwrap_or_default()
}
