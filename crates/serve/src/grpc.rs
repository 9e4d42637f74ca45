//! The gRPC door: the same jobs, limits and errors as the HTTP one.

use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
};

use bytes::{Bytes, BytesMut};
use tonic::{Code, Request, Response, Status, Streaming, codegen::tokio_stream::Stream};

use super::{
    app::App,
    intake::{Asked, Patience},
    problem::Fault,
    question::Question,
    telemetry::RequestId,
};
use darn_contract::port::Mended;
use darn_contract::{
    Constraints, Search,
    v1::{
        self, AnchorFound, HolesReport, InpaintChunk, ScanChunk,
        darn_server::{Darn, DarnServer},
        inpaint_chunk::Part,
    },
};

/// Bytes of a scan per message of an answer.
const CHUNK: usize = 256 << 10;
/// Bytes of a message that comes in. Read as messages, empty ones at worst, they take up to 36 times as much memory: as much as a body of
/// the usual limit.
const MESSAGE: usize = 4 << 20;

/// The service, ready to be routed.
pub fn service(app: &Arc<App>) -> DarnServer<Door> {
    DarnServer::new(Door(Arc::clone(app)))
        .max_decoding_message_size(MESSAGE)
        .max_encoding_message_size(usize::MAX)
}

/// Answers gRPC calls.
#[derive(Debug)]
pub struct Door(Arc<App>);

#[tonic::async_trait]
impl Darn for Door {
    type InpaintStream = Chunks;

    async fn find_holes(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<HolesReport>, Status> {
        let id = id(&request);
        self.holes(request.into_inner())
            .await
            .map(Response::new)
            .map_err(|fault| fault.grpc(&id))
    }

    async fn inpaint(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<Chunks>, Status> {
        let id = id(&request);
        let mended = self
            .mend(request.into_inner())
            .await
            .map_err(|fault| fault.grpc(&id))?;
        Ok(Response::new(Chunks::of(mended)))
    }

    async fn optimize_anchor(
        &self,
        request: Request<Streaming<ScanChunk>>,
    ) -> Result<Response<AnchorFound>, Status> {
        let id = id(&request);
        self.search(request.into_inner())
            .await
            .map(Response::new)
            .map_err(|fault| fault.grpc(&id))
    }
}

impl Door {
    async fn holes(&self, stream: Streaming<ScanChunk>) -> Result<HolesReport, Fault> {
        let Asked { scan, upload, .. } = self.read(stream).await?.unconstrained()?;
        self.0
            .submit(upload, move |mender, _| mender.find_holes(&scan))
            .await
    }

    async fn mend(&self, stream: Streaming<ScanChunk>) -> Result<Mended, Fault> {
        let Asked {
            scan,
            question,
            upload,
        } = self.read::<Constraints>(stream).await?;
        let asked = question.unwrap_or_default();
        let mended = self
            .0
            .submit(upload, move |mender, cancellation| {
                mender.inpaint(&scan, &asked, cancellation)
            })
            .await?;
        self.0.metrics.mended(&mended.report);
        Ok(mended)
    }

    async fn search(&self, stream: Streaming<ScanChunk>) -> Result<AnchorFound, Fault> {
        let Asked {
            scan,
            question,
            upload,
        } = self.read::<Search>(stream).await?;
        let place = "the field `query` of the first chunk";
        let search = question.ok_or(Fault::NoQuery { place })?;
        self.0
            .submit(upload, move |mender, cancellation| {
                mender.optimize_anchor(&scan, &search, cancellation)
            })
            .await
    }

    async fn read<Q: Carried>(&self, mut stream: Streaming<ScanChunk>) -> Result<Asked<Q>, Fault> {
        let upload = self.0.upload()?;
        let limit = self.0.limits.body;
        let patience = Patience::new(&self.0.limits);
        let mut question = None;
        let mut scan = BytesMut::new();
        let mut first = true;
        while let Some(mut chunk) = patience
            .next(stream.message())
            .await?
            .map_err(|status| broken(&status))?
        {
            if let Some(message) = Q::take(&mut chunk) {
                if !first {
                    let part = Q::PART;
                    let detail = format!("only the first chunk carries `{part}`");
                    return Err(Fault::Malformed(detail));
                }
                question = Some(Q::of(&message)?);
            }
            if chunk.constraints.is_some() || chunk.query.is_some() {
                return Err(Fault::Malformed(
                    "OptimizeAnchor takes a query and no constraints, the other methods no query"
                        .to_owned(),
                ));
            }
            if scan.len() + chunk.data.len() > limit {
                return Err(Fault::TooLarge { limit });
            }
            scan.extend_from_slice(&chunk.data);
            first = false;
        }
        if scan.is_empty() {
            return Err(Fault::EmptyBody);
        }
        Ok(Asked {
            scan: scan.freeze(),
            question,
            upload,
        })
    }
}

/// A question with its own field in a chunk.
trait Carried: Question {
    /// Takes it out of a chunk.
    fn take(chunk: &mut ScanChunk) -> Option<Self::Message>;
}

impl Carried for Constraints {
    fn take(chunk: &mut ScanChunk) -> Option<v1::Constraints> {
        chunk.constraints.take()
    }
}

impl Carried for Search {
    fn take(chunk: &mut ScanChunk) -> Option<v1::AnchorQuery> {
        chunk.query.take()
    }
}

fn broken(status: &Status) -> Fault {
    match status.code() {
        // What tonic says of a message above its limit.
        Code::OutOfRange => Fault::MessageTooLarge { limit: MESSAGE },
        _ => Fault::Malformed(format!("the stream broke off: {}", status.message())),
    }
}

fn id<T>(request: &Request<T>) -> String {
    request
        .extensions()
        .get::<RequestId>()
        .map(|id| id.0.clone())
        .unwrap_or_default()
}

/// An answer in chunks: the report, then the scan.
#[derive(Debug)]
pub struct Chunks {
    report: Option<Part>,
    scan: Bytes,
}

impl Chunks {
    fn of(mended: Mended) -> Self {
        Self {
            report: Some(Part::Report(mended.report)),
            scan: mended.bytes.into(),
        }
    }
}

impl Stream for Chunks {
    type Item = Result<InpaintChunk, Status>;

    fn poll_next(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        let part = self.report.take().or_else(|| {
            let next = self.scan.len().min(CHUNK);
            (next > 0).then(|| Part::Data(self.scan.split_to(next)))
        });
        Poll::Ready(part.map(|part| Ok(InpaintChunk { part: Some(part) })))
    }
}
