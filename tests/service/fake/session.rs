//! A session of the fake mender.

use super::*;

/// A session; counts itself in [`FakeMender::kept`].
pub(super) struct FakeSession {
    fake: FakeMender,
    scan: FakeScan,
}

impl FakeSession {
    pub(super) fn new(fake: &FakeMender, scan: FakeScan) -> Self {
        fake.0.kept.fetch_add(1, Relaxed);
        Self {
            fake: fake.clone(),
            scan,
        }
    }
}

impl Drop for FakeSession {
    fn drop(&mut self) {
        self.fake.0.kept.fetch_sub(1, Relaxed);
    }
}

impl EditSession for FakeSession {
    fn described(&self) -> v1::Session {
        v1::Session {
            holes: vec![v1::SessionHole {
                id: 2,
                rim_uvs: vec![0.25, 0.5],
                ..Default::default()
            }],
            bytes: self.bytes() as u64,
            ..Default::default()
        }
    }

    fn outcome(&self) -> Outcome {
        Outcome {
            filled: 1,
            ..Outcome::default()
        }
    }

    fn bytes(&self) -> usize {
        self.scan.kept_bytes
    }

    fn patches(
        &self,
        constraints: &Constraints,
        form: PatchForm,
        _: &Budget<'_>,
    ) -> Result<Patches, Refusal> {
        self.fake.act_on_edit(constraints)?;
        let positions = constraints.anchors.iter().flat_map(|a| a.position);
        let bytes = match form {
            PatchForm::Glb => b"glTF patches".to_vec(),
            PatchForm::Positions => positions.flat_map(|x| (x as f32).to_le_bytes()).collect(),
        };
        Ok(Patches {
            bytes,
            report: report(constraints),
        })
    }

    /// The positions of the anchors, without the normals.
    fn draft(&self, constraints: &Constraints, budget: &Budget<'_>) -> Result<Vec<u8>, Refusal> {
        (self.patches(constraints, PatchForm::Positions, budget)).map(|patches| patches.bytes)
    }

    fn mended(&self, constraints: &Constraints, _: &Budget<'_>) -> Result<Mended, Refusal> {
        let xs: Vec<f64> = constraints.anchors.iter().map(|a| a.position[0]).collect();
        Ok(Mended {
            bytes: format!("glTF {} {xs:?}", self.scan.name).into_bytes(),
            media_type: "model/gltf-binary",
            report: report(constraints),
            file: None,
        })
    }

    fn optimize_anchor(&self, search: &Search, _: &Budget<'_>) -> Result<v1::AnchorFound, Refusal> {
        Ok(found(search))
    }

    /// A map of [`MAP_CELLS`] cells; the loss of each is its index.
    fn map_piece(
        &self,
        _: &Search,
        span: MapSpan,
        _: &Budget<'_>,
    ) -> Result<v1::MapPiece, Refusal> {
        self.fake.act_on_piece()?;
        let cells = (span.first..MAP_CELLS).take(span.count);
        Ok(v1::MapPiece {
            cells: cells.clone().map(|k| k as u32).collect(),
            losses: cells.map(|k| k as f64).collect(),
            gradients: Vec::new(),
            total: MAP_CELLS as u32,
        })
    }
}
