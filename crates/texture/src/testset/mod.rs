//! Test sets with known answers: ten fabrics, three layouts, three sizes of holes, and what other fillers make of them. Beside the set on which the
//! completion's constants were chosen there are siblings of it, as many as there are seeds.

mod draw;
mod fabric;
mod metrics;
mod peers;
mod scan;
mod ssim;

pub use draw::Family;
pub use fabric::{FABRICS, Fabric, Swatch};
pub use metrics::{Comparison, Phases, Scores, ciede2000, lab};
pub use peers::{Peer, continued};
pub use scan::{HOLES, LAYOUTS, Layout, TestScan};
pub use ssim::LightPair;

use darn_budget::Budget;

use crate::{Completion, ContinuedScore, PatchTexture, Settings, TextureError};

/// The cloth around a hole laid flat, as a completion sees it: for fillers of pictures.
pub struct ClothRaster {
    /// Columns.
    pub width: usize,
    /// The first layer.
    pub texels: Vec<[u8; 4]>,
    /// Which texels show cloth.
    pub known: Vec<bool>,
    /// Which texels are to be filled.
    pub hole: Vec<bool>,
    /// Per texel of the patch's image: its texel of the raster.
    pub of_image: Vec<usize>,
}

impl ClothRaster {
    /// What a completion has read. Texels of a mirrored cloth that its other side shows are known.
    pub fn new(completion: &Completion) -> ClothRaster {
        let gathered = &completion.gathered;
        let page = gathered.frame.len();
        let cut = completion.cut();
        let known = gathered.known[..page].to_vec();
        ClothRaster {
            width: gathered.frame.width,
            texels: gathered.layers[0][..page].to_vec(),
            hole: (0..page)
                .map(|k| gathered.missing[k] && !known[k])
                .collect(),
            known,
            of_image: (0..cut.len())
                .map(|k| cut.texel(k, gathered.frame.width))
                .collect(),
        }
    }
}

/// What fillers make of one hole.
pub struct Trial {
    /// Columns of all pictures.
    pub width: usize,
    /// The truth.
    pub truth: Vec<[u8; 4]>,
    /// The completion, [`Peer::Continue`] and [`Peer::Average`].
    pub made: [Vec<[u8; 4]>; 3],
    /// Their scores.
    pub scores: [Scores; 3],
    /// What [`Completion::score_continued`] says of [`Peer::Continue`].
    pub continued: ContinuedScore,
}

impl Trial {
    /// Completes a hole by all fillers and scores them.
    ///
    /// # Errors
    /// As [`Completion::new`].
    pub fn new(scan: &TestScan) -> Result<Trial, TextureError> {
        let budget = Budget::unlimited();
        let cloth = scan.cloth();
        let completion = Completion::new(&cloth, &scan.patch, &Settings::default(), budget)?;
        let PatchTexture { width, layers, .. } = completion.texture(budget)?;
        let texture = layers.into_iter().next().unwrap_or_default();
        let truth = scan.truth_texels(&completion.places());
        let peers = [Peer::Continue, Peer::Average].map(|peer| continued(scan, peer));
        let image = |k: usize| completion.continued_image(&peers[k], budget);
        let made = [texture, image(0)?, image(1)?];
        let [hole, known] = completion.masks();
        let width = width as usize;
        let phases = Phases::new(&scan.swatch, completion.step());
        let scores = made.each_ref().map(|made| {
            let comparison = Comparison {
                width,
                made,
                truth: &truth,
                hole: &hole,
                known: &known,
            };
            comparison.scores(&phases)
        });
        let continued = completion.score_continued(&peers[0], budget)?;
        Ok(Trial {
            width,
            truth,
            made,
            scores,
            continued,
        })
    }
}
