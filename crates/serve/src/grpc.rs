//! The gRPC service: the same jobs, limits and errors as over HTTP.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use bytes::Bytes;
use tonic::{Code, Request, Response, Status, Streaming, codegen::tokio_stream::Stream};

use super::generated::darn_server::{Darn, DarnServer};
use super::{
    app::App,
    body::{BodyTimer, ScanRequest},
    client::Caller,
    counted::CountedBytes,
    error::RequestError,
    parameters::Parameters,
    scan_files::ScanFiles,
    telemetry::RequestId,
    uploads::BodySize,
};
use darn_contract::port::{HolesQuery, Mended, ScanForm, Stripped};
use darn_contract::{
    Constraints, Search, excerpt,
    v1::{
        self, AnchorFound, HolesReport, InpaintChunk, ScanChunk, StripChunk, inpaint_chunk::Part,
        strip_chunk,
    },
};

/// Bytes of a scan per message of an answer.
const CHUNK_BYTES: usize = 256 << 10;
/// Most bytes of an incoming message. Decoded, its nested messages take up to 36 times as much memory: about the default body limit.
const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// The service, ready to be routed. tonic encodes each answer on an async thread; protobuf takes a fraction of JSON's time for it.
pub fn service(app: &Arc<App>) -> DarnServer<GrpcService> {
    DarnServer::new(GrpcService(Arc::clone(app)))
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(usize::MAX)
}

/// Answers gRPC calls.
#[derive(Debug)]
pub struct GrpcService(Arc<App>);

#[tonic::async_trait]
impl Darn for GrpcService {
    type InpaintStream = ChunkStream<InpaintChunk>;
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
    ) -> Result<Response<ChunkStream<InpaintChunk>>, Status> {
        let id = request_id(&request);
        let mended = self.mend(request).await.map_err(|error| error.grpc(&id))?;
        Ok(Response::new(ChunkStream::of_mended(mended)))
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
        let mut stream = request.into_inner();
        let upload = self.0.upload_permit_for(BodySize::Large, client)?;
        let limit = self.0.limits.body;
        let timer = BodyTimer::new(&self.0.limits);
        let mut parameters = None;
        let mut scan = CountedBytes::new(&self.0.limits.memory)?;
        let mut first = true;
        while let Some(mut chunk) = timer
            .next(stream.message())
            .await?
            .map_err(|status| stream_error(&status))?
        {
            if let Some(message) = P::take(&mut chunk) {
                if !first {
                    let part = P::PART;
                    let detail = format!("only the first chunk carries `{part}`");
                    return Err(RequestError::Malformed(detail));
                }
                parameters = Some(P::from_message(&message)?);
            }
            if chunk.constraints.is_some() || chunk.query.is_some() || chunk.holes.is_some() {
                return Err(RequestError::Malformed(
                    "Inpaint takes `constraints`, OptimizeAnchor `query`, FindHoles `holes`, none of them another's, and Strip none"
                        .to_owned(),
                ));
            }
            if scan.len() + chunk.data.len() > limit {
                return Err(RequestError::TooLarge { limit });
            }
            scan.extend(&chunk.data)?;
            first = false;
        }
        if scan.len() == 0 {
            return Err(RequestError::EmptyBody);
        }
        let scan = scan.freeze();
        Ok(ScanRequest {
            files: ScanFiles::of(&scan),
            scan,
            parameters,
            upload,
        })
    }
}

/// Parameters as a field of a chunk.
trait ChunkParameters: Parameters {
    /// Takes their message out of a chunk.
    fn take(chunk: &mut ScanChunk) -> Option<Self::Message>;
}

impl ChunkParameters for Constraints {
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

fn stream_error(status: &Status) -> RequestError {
    match status.code() {
        // tonic's code for a message above its limit.
        Code::OutOfRange => RequestError::MessageTooLarge {
            limit: MAX_MESSAGE_BYTES,
        },
        _ => RequestError::Malformed(format!(
            "the stream broke off: {}",
            excerpt(status.message())
        )),
    }
}

fn request_id<T>(request: &Request<T>) -> String {
    request
        .extensions()
        .get::<RequestId>()
        .map(|id| id.0.clone())
        .unwrap_or_default()
}

/// A scan in chunks: the report, then the scan's bytes in order.
#[derive(Debug)]
pub struct ChunkStream<C> {
    /// The first chunk, until it is sent.
    report: Option<C>,
    scan: Bytes,
    /// Makes a chunk of bytes.
    data: fn(Bytes) -> C,
}

impl ChunkStream<InpaintChunk> {
    fn of_mended(mended: Mended) -> Self {
        Self {
            report: Some(InpaintChunk {
                part: Some(Part::Report(mended.report)),
            }),
            scan: mended.bytes.into(),
            data: |bytes| InpaintChunk {
                part: Some(Part::Data(bytes)),
            },
        }
    }
}

impl ChunkStream<StripChunk> {
    fn of_stripped(stripped: Stripped) -> Self {
        Self {
            report: Some(StripChunk {
                part: Some(strip_chunk::Part::Report(stripped.report)),
            }),
            scan: stripped.bytes.into(),
            data: |bytes| StripChunk {
                part: Some(strip_chunk::Part::Data(bytes)),
            },
        }
    }
}

impl<C: Unpin> Stream for ChunkStream<C> {
    type Item = Result<C, Status>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let chunk = self.report.take().or_else(|| {
            let next = self.scan.len().min(CHUNK_BYTES);
            (next > 0).then(|| (self.data)(self.scan.split_to(next)))
        });
        Poll::Ready(chunk.map(Ok))
    }
}
