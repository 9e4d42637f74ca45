//! The colour of patches: the scan's texture coordinates continued, images of their own, one colour, or none.
//!
//! Left to itself, a patch continues the texture coordinates where that shows it as the cloth around it looks, by a measure of the
//! completion's; elsewhere, as on an atlas of islands, it gets images of its own. The chart does not change with the cloth's folds, so a
//! session completes a hole's images once.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use darn_contract::{TextureChoice, v1};
use darn_gltf_scan::{ClothLook, NoLook, PatchAppearance, PatchPrimitive, ScanLimits};
use darn_texture::{
    Completion, PatchTexture, Settings, TextureError, estimated_bytes, mean_texels,
};
use rayon::prelude::*;

use crate::addition::{DressedPatch, PatchSource};
use crate::error::MendError;
use crate::hole_report::FilledHole;
use crate::laid_cloth::LaidCloth;
use crate::prepared_hole::HoleRef;
use crate::texture_cloth::TextureCloth;
use crate::texture_images::ImageCache;
use crate::texture_patch::{flat_colours, no_columns, with};
use crate::timings::milliseconds;

/// Why a patch has no images of its own where the request asks for none in particular.
const NO_CHART: &str =
    "the cloth around the hole and its patch cannot be laid flat together to lay a texture in";

/// A patch as it goes to the scan, and what its report says.
pub struct ColouredPatch {
    /// The primitive.
    pub primitive: PatchPrimitive,
    /// Where its colour comes from.
    pub report: v1::TextureReport,
    /// What a person should know: why it has no images of its own where it should.
    pub note: Option<String>,
    /// Milliseconds.
    pub texture_ms: f64,
}

/// How a hole's patch looks, whatever its folds.
#[derive(Debug)]
struct HoleTexture {
    style: TextureStyle,
    report: v1::TextureReport,
    note: Option<String>,
}

#[derive(Debug)]
enum TextureStyle {
    Continued,
    Own(OwnImages),
    Flat(Arc<ClothLook>, Vec<[f32; 4]>),
}

/// A patch's own images, and the patch in the chart.
#[derive(Debug)]
pub struct OwnImages {
    /// What the images are.
    pub look: Arc<ClothLook>,
    /// Their size, and the patch's places in them.
    pub texture: PatchTexture,
    /// Their texels, per layer.
    pub layers: Arc<Vec<Vec<[u8; 4]>>>,
    /// The patch in the chart.
    pub chart: darn_texture::PatchChart,
}

/// The textures that a hole's patch was given, by what was asked for; they do not depend on its folds.
#[derive(Default)]
pub struct HoleTextures(Mutex<Vec<(Option<TextureChoice>, Arc<HoleTexture>)>>);

impl HoleTextures {
    fn get(&self, choice: Option<TextureChoice>) -> Option<Arc<HoleTexture>> {
        let kept = self.lock();
        let mut each = kept.iter();
        each.find(|(c, _)| *c == choice).map(|(_, t)| Arc::clone(t))
    }

    fn keep(&self, choice: Option<TextureChoice>, texture: HoleTexture) {
        self.lock().push((choice, Arc::new(texture)));
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        let kept = self.lock();
        let each = kept.iter().map(|(_, texture)| match &texture.style {
            TextureStyle::Own(own) => {
                4 * own.layers.iter().map(Vec::len).sum::<usize>() + 16 * own.chart.flat.len()
            }
            _ => 0,
        });
        each.sum()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<(Option<TextureChoice>, Arc<HoleTexture>)>> {
        // No change under the lock can panic half-way.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What colours the patches of one request.
pub struct Colouring<'a> {
    /// Where patches get their attributes from.
    pub source: PatchSource<'a>,
    /// What the request asks for.
    pub choice: Option<TextureChoice>,
    /// Limits of a patch's images.
    pub settings: Settings,
    /// Limits of the scan's images.
    pub scan_limits: &'a ScanLimits,
}

/// Bytes that completions done at once may take together; a larger one is done alone.
const AT_ONCE: usize = 256 << 20;
/// Holes whose cloth is laid out at once.
const LAID_AT_ONCE: usize = 64;

/// A hole whose texture is to be made.
#[derive(Clone)]
struct TextureTask<'t> {
    /// Index among the filled holes.
    index: usize,
    hole: HoleRef<'t>,
    look: Arc<ClothLook>,
}

/// The cloth of a task.
struct LaidTask<'t> {
    task: TextureTask<'t>,
    laid: TextureCloth<'t>,
    /// Bytes that its completion takes.
    bytes: Result<usize, TextureError>,
    laid_ms: f64,
}

impl Colouring<'_> {
    /// The patches with their colours, in order. What fits into the request's memory does not depend on threads: the holes are taken in
    /// order, as many at once as stay within a fixed size.
    ///
    /// # Errors
    /// `Exhausted`.
    pub fn coloured(
        &self,
        filled: &[FilledHole],
        dressed: Vec<DressedPatch>,
    ) -> Result<Vec<ColouredPatch>, MendError> {
        let mut times = vec![0.0; filled.len()];
        let mut images = ImageCache::default();
        let tasks = self.tasks(filled, &dressed, &mut images)?;
        for tasks in tasks.chunks(LAID_AT_ONCE) {
            let laid = tasks.par_iter().map(|task| {
                let (started, dressed) = (Instant::now(), &dressed[task.index]);
                let Some(laid) = LaidCloth::of(task.hole, dressed, &self.source)? else {
                    task.hole.textures().keep(self.choice, refused(NO_CHART));
                    return Ok(None);
                };
                let (scan, look) = (self.source.scan, &task.look);
                let laid = TextureCloth::of(&laid, dressed, scan, look, &images.decoded);
                Ok(Some(LaidTask {
                    task: task.clone(),
                    bytes: estimated_bytes(&laid.cloth, &laid.patch, &self.settings),
                    laid,
                    laid_ms: milliseconds(started),
                }))
            });
            let laid: Vec<Option<LaidTask>> = laid.collect::<Result<_, MendError>>()?;
            self.complete(laid.into_iter().flatten().collect(), &mut times)?;
        }
        images.release(self.source.budget);
        let all = filled.par_iter().zip(dressed).zip(times);
        let all = all.map(|((filled, dressed), texture_ms)| {
            let started = Instant::now();
            let patch = self.patch(filled, dressed);
            ColouredPatch {
                texture_ms: texture_ms + milliseconds(started),
                ..patch
            }
        });
        Ok(all.collect())
    }

    /// The holes whose textures are to be completed, with their images decoded; what can be said of the others without is kept.
    fn tasks<'t>(
        &self,
        filled: &'t [FilledHole],
        dressed: &[DressedPatch],
        images: &mut ImageCache,
    ) -> Result<Vec<TextureTask<'t>>, MendError> {
        let mut tasks = Vec::new();
        if self.choice == Some(TextureChoice::None) {
            return Ok(tasks);
        }
        for (index, (filled, dressed)) in filled.iter().zip(dressed).enumerate() {
            let hole = filled.hole;
            if hole.textures().get(self.choice).is_some() {
                continue;
            }
            match self.look(dressed, images)? {
                Ok(look) => tasks.push(TextureTask { index, hole, look }),
                Err(without) => hole.textures().keep(self.choice, without),
            }
        }
        Ok(tasks)
    }

    /// Completes the textures of holes, as many at once as their size allows.
    fn complete(&self, mut laid: Vec<LaidTask>, times: &mut [f64]) -> Result<(), MendError> {
        while !laid.is_empty() {
            let left = self.source.budget.memory_left();
            let mut sum = 0;
            let fits = laid.iter().take_while(|task| {
                sum += task.bytes.as_ref().map_or(0, |bytes| *bytes);
                sum <= AT_ONCE.min(left)
            });
            let count = fits.count().max(1);
            let rest = laid.split_off(count);
            let done = std::mem::replace(&mut laid, rest).into_par_iter();
            let done: Vec<Result<(usize, f64), MendError>> = done
                .map(|task| {
                    let (started, index, laid_ms) = (Instant::now(), task.task.index, task.laid_ms);
                    self.complete_one(task, left)?;
                    Ok((index, laid_ms + milliseconds(started)))
                })
                .collect();
            for done in done {
                let (index, milliseconds) = done?;
                times[index] = milliseconds;
            }
        }
        Ok(())
    }

    /// Completes the texture of a hole and keeps it; `left` is what memory there was before.
    fn complete_one(&self, laid: LaidTask, left: usize) -> Result<(), MendError> {
        let LaidTask {
            task, laid, bytes, ..
        } = laid;
        let completed = match bytes {
            Ok(bytes) if bytes > left => Ok(refused(format!(
                "a texture of its own would take {} MiB, more than the request has left",
                bytes >> 20
            ))),
            Ok(_) => self.completed(&task.look, laid),
            Err(error) => Err(error),
        };
        let texture = match completed {
            Ok(texture) => texture,
            Err(TextureError::Exhausted(exhausted)) => return Err(exhausted.into()),
            Err(reason) => refused(reason.to_string()),
        };
        task.hole.textures().keep(self.choice, texture);
        Ok(())
    }

    /// A patch as it goes to the scan; its texture is made.
    fn patch(&self, filled: &FilledHole, dressed: DressedPatch) -> ColouredPatch {
        if self.choice == Some(TextureChoice::None) {
            let (plain, _) = self
                .source
                .undivided(filled, &dressed, &no_columns(&dressed));
            let report = report_of("none", String::new());
            return coloured(with(plain, PatchAppearance::Plain), report, None);
        }
        let Some(texture) = filled.hole.textures().get(self.choice) else {
            let HoleTexture { report, note, .. } = refused(NO_CHART);
            return coloured(self.source.continued(filled, dressed), report, note);
        };
        let primitive = match &texture.style {
            TextureStyle::Continued => match self.choice {
                Some(TextureChoice::Flat) => flat_colours(self.source.continued(filled, dressed)),
                _ => self.source.continued(filled, dressed),
            },
            TextureStyle::Own(own) => self.source.in_own_images(filled, &dressed, own),
            TextureStyle::Flat(look, means) => {
                let (flat, _) = self
                    .source
                    .undivided(filled, &dressed, &no_columns(&dressed));
                with(flat, PatchAppearance::Flat(Arc::clone(look), means.clone()))
            }
        };
        coloured(primitive, texture.report.clone(), texture.note.clone())
    }

    /// How the cloth around a hole looks, with its images decoded; inside, what a patch gets where that cannot be told.
    fn look(
        &self,
        dressed: &DressedPatch,
        images: &mut ImageCache,
    ) -> Result<Result<Arc<ClothLook>, HoleTexture>, MendError> {
        if self.choice == Some(TextureChoice::Continue) {
            return Ok(Err(continued(String::new())));
        }
        let mut parts: Vec<usize> = dressed.sources.iter().flatten().map(|s| s.part).collect();
        parts.sort_unstable();
        parts.dedup();
        let scan = self.source.scan;
        let look = match scan.cloth_look(&parts, dressed.primitive.material_of) {
            Ok(look) => images.shared(look),
            Err(NoLook::NoTexture) if self.choice == Some(TextureChoice::Flat) => {
                return Ok(Err(HoleTexture {
                    style: TextureStyle::Continued,
                    report: report_of("flat", String::new()),
                    note: None,
                }));
            }
            Err(NoLook::NoTexture) => {
                return Ok(Err(continued(NoLook::NoTexture.to_string())));
            }
            Err(reason) => return Ok(Err(refused(reason.to_string()))),
        };
        for image in look.images() {
            if let Err(reason) = images.decode(image, &self.source, self.scan_limits)? {
                return Ok(Err(refused(reason)));
            }
        }
        Ok(Ok(look))
    }

    /// The patch's images, or their means, or that it looks as good without.
    fn completed(
        &self,
        look: &Arc<ClothLook>,
        laid: TextureCloth,
    ) -> Result<HoleTexture, TextureError> {
        let (budget, settings) = (self.source.budget, &self.settings);
        let TextureCloth {
            cloth,
            patch,
            continued,
        } = &laid;
        if self.choice == Some(TextureChoice::Flat) {
            let means = mean_texels(cloth, patch, settings, budget)?;
            return Ok(HoleTexture {
                style: TextureStyle::Flat(Arc::clone(look), means),
                report: report_of("flat", String::new()),
                note: None,
            });
        }
        let completion = Completion::new(cloth, patch, settings, budget)?;
        let score = completion.score_continued(continued, budget)?;
        let compared = |report: v1::TextureReport| v1::TextureReport {
            continued_difference: Some(score.hole),
            cloth_difference: Some(score.cloth),
            ..report
        };
        if self.choice.is_none() && score.is_as_good() {
            completion.release(budget);
            let reason = "the continued texture looks like the cloth around the hole";
            return Ok(HoleTexture {
                style: TextureStyle::Continued,
                report: compared(report_of("continued", reason.to_owned())),
                note: None,
            });
        }
        let mut texture = completion.texture(budget)?;
        completion.release(budget);
        let reason = match self.choice {
            None => "the continued texture does not look like the cloth around the hole",
            Some(_) => "",
        };
        let report = v1::TextureReport {
            width: texture.width,
            height: texture.height,
            layers: texture.layers.len() as u32,
            ..compared(report_of("synthesized", reason.to_owned()))
        };
        let layers = std::mem::take(&mut texture.layers);
        budget.hold(4 * layers.iter().map(Vec::len).sum::<usize>())?;
        let own = OwnImages {
            look: Arc::clone(look),
            texture,
            layers: Arc::new(layers),
            chart: laid.patch,
        };
        Ok(HoleTexture {
            style: TextureStyle::Own(own),
            report,
            note: None,
        })
    }
}

/// A patch that continues the scan's texture coordinates, and why.
fn continued(reason: String) -> HoleTexture {
    HoleTexture {
        style: TextureStyle::Continued,
        report: report_of("continued", reason),
        note: None,
    }
}

/// The same where the patch should look otherwise, but cannot.
fn refused(reason: impl Into<String>) -> HoleTexture {
    let reason = reason.into();
    HoleTexture {
        note: Some(format!(
            "the new cloth continues the scan's texture coordinates, which may show other places of its images: {reason}"
        )),
        ..continued(reason)
    }
}

/// A patch, without the time that its texture took.
fn coloured(
    primitive: PatchPrimitive,
    report: v1::TextureReport,
    note: Option<String>,
) -> ColouredPatch {
    ColouredPatch {
        primitive,
        report,
        note,
        texture_ms: 0.0,
    }
}

fn report_of(method: &str, reason: String) -> v1::TextureReport {
    v1::TextureReport {
        method: method.to_owned(),
        reason,
        ..v1::TextureReport::default()
    }
}
