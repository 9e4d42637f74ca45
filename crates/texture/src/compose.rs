//! From labels to images: every texel of the hole copies its source, seams are blended, and the patch's part is cut out.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::blend::{Equation, Value, solve};
use crate::frame::NONE;
use crate::gather::Gathered;
use crate::input::LayerKind;
use crate::labels::{Labelling, UNLABELLED};
use crate::offsets::{Known, Offset};
use crate::resample::encode_vector;
use crate::shading::{Pair, Shading};

/// Nanoseconds of work for a texel of the hole.
const TEXEL_WORK: u64 = 60;
/// Steps at seams beyond this are edges of patterns that do not meet; blending them would only spread a haze.
const MOST_STEP: f32 = 0.12;
/// Rows that one task labels.
const BAND: usize = 16;
/// Copies of copies that are followed at most.
const MOST_COPIES: usize = 8;

/// Where each texel of the raster is copied from.
pub(crate) struct Field {
    /// Per texel: the known texel that it copies; [`NONE`] where nothing is copied.
    pub source: Vec<u32>,
}

impl Field {
    /// Labels every texel of the hole.
    pub(crate) fn new(
        gathered: &Gathered,
        labelling: &Labelling,
        budget: &Budget,
    ) -> Result<Field, Exhausted> {
        let raster = &gathered.raster();
        let mut source = vec![NONE; raster.hole.len()];
        let rows = source.par_chunks_mut(raster.width * BAND).enumerate();
        rows.try_for_each(|(band, sources)| {
            let first = band * BAND * raster.width;
            let mut count = 0;
            for (k, source) in sources.iter_mut().enumerate() {
                if !raster.hole[first + k] {
                    continue;
                }
                count += 1;
                let label = labelling.label(raster, first + k);
                if label != UNLABELLED {
                    let found = raster.source(first + k, labelling.offsets[label as usize]);
                    *source = found.map_or(NONE, |at| at as u32);
                }
            }
            budget.spend(TEXEL_WORK * count)
        })?;
        let mut field = Field { source };
        field.follow_copies(raster, &labelling.offsets, budget)?;
        gathered.copy_mirrored(&mut field.source);
        Ok(field)
    }

    /// Texels without a known source copy what a texel of the hole copies.
    fn follow_copies(
        &mut self,
        raster: &Known,
        offsets: &[Offset],
        budget: &Budget,
    ) -> Result<(), Exhausted> {
        for _ in 0..MOST_COPIES {
            let open: Vec<usize> = (0..raster.hole.len())
                .filter(|at| raster.hole[*at] && self.source[*at] == NONE)
                .collect();
            if open.is_empty() {
                return Ok(());
            }
            budget.spend((open.len() * offsets.len() * 4) as u64)?;
            let found: Vec<Option<u32>> = (open.iter())
                .map(|at| offsets.iter().find_map(|o| self.copied(raster, *at, *o)))
                .collect();
            for (at, found) in open.iter().zip(&found) {
                self.source[*at] = found.unwrap_or(NONE);
            }
            if found.iter().all(Option::is_none) {
                return Ok(());
            }
        }
        Ok(())
    }

    fn copied(&self, raster: &Known, at: usize, offset: Offset) -> Option<u32> {
        let source = self.source[raster.moved(at, offset)?];
        (source != NONE).then_some(source)
    }

    /// The shading of a layer: pairs are samples of the known cloth at the labels' offsets.
    pub(crate) fn shading(
        raster: &Known,
        labelling: &Labelling,
        layer: &[[u8; 4]],
        samples: &[usize],
    ) -> Option<Shading> {
        let mut used = vec![0usize; labelling.offsets.len()];
        for label in labelling.labels.iter().filter(|l| **l != UNLABELLED) {
            used[*label as usize] += 1;
        }
        let place = |at: usize| [(at % raster.width) as f32, (at / raster.width) as f32];
        let mut pairs = Vec::new();
        for (offset, _) in labelling
            .offsets
            .iter()
            .zip(&used)
            .filter(|(_, used)| **used > 0)
        {
            for at in samples.iter().step_by(3) {
                let Some(to) = raster.source(*at, *offset) else {
                    continue;
                };
                let (a, b) = (layer[*at].map(f32::from), layer[to].map(f32::from));
                pairs.push(Pair {
                    from: place(*at),
                    to: place(to),
                    change: std::array::from_fn(|k| (b[k] - a[k]) / 255.0),
                });
            }
        }
        Shading::fit(&pairs, raster.width.max(raster.height))
    }
}

/// A rectangle of the raster.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cut {
    pub left: usize,
    pub top: usize,
    pub width: usize,
    pub height: usize,
}

impl Cut {
    /// The raster's texel at a texel of the cut.
    pub(crate) fn texel(&self, at: usize, width: usize) -> usize {
        (self.top + at / self.width) * width + self.left + at % self.width
    }

    pub(crate) fn len(&self) -> usize {
        self.width * self.height
    }
}

/// A layer of the raster that is to be composed.
pub(crate) struct ComposedLayer<'a> {
    pub kind: LayerKind,
    /// On all pages.
    pub texels: &'a [[u8; 4]],
    /// The light over its cloth.
    pub shading: Option<&'a Shading>,
}

/// One layer's picture of a cut: known texels bit for bit, copies in the hole, colours of their surroundings elsewhere.
pub(crate) fn compose(
    gathered: &Gathered,
    field: &Field,
    layer: &ComposedLayer,
    cut: &Cut,
    budget: &Budget,
) -> Result<Vec<[u8; 4]>, Exhausted> {
    let ComposedLayer {
        kind,
        texels: layer,
        shading,
    } = *layer;
    let width = gathered.frame.width;
    let picture = Picture {
        width,
        known: &gathered.known,
        field,
        layer,
        shading,
    };
    budget.spend(TEXEL_WORK * cut.len() as u64)?;
    let at = |k: usize| cut.texel(k, width);
    let mut values: Vec<Value> = (0..cut.len())
        .into_par_iter()
        .map(|k| picture.value(at(k)))
        .collect();
    let covered: Vec<bool> = (0..cut.len())
        .map(|k| gathered.known[at(k)] || field.source[at(k)] != NONE)
        .collect();
    if !kind.is_vector() {
        let correction = solve(picture.equation(cut, &values), budget)?;
        values
            .par_iter_mut()
            .zip(&correction)
            .for_each(|(value, c)| {
                (0..4).for_each(|k| value[k] += c[k]);
            });
    }
    crate::gutter::fill(&mut values, &covered, cut.width);
    Ok((0..cut.len())
        .into_par_iter()
        .map(|k| {
            let texel = at(k);
            if gathered.known[texel] {
                return layer[texel];
            }
            if kind.is_vector() {
                return encode_vector(kind, values[k]);
            }
            values[k].map(|x| (255.0 * x.clamp(0.0, 1.0) + 0.5) as u8)
        })
        .collect())
}

/// A layer's raster seen through the copies.
struct Picture<'a> {
    width: usize,
    /// Which texels show cloth, on all pages.
    known: &'a [bool],
    field: &'a Field,
    layer: &'a [[u8; 4]],
    shading: Option<&'a Shading>,
}

impl Picture<'_> {
    fn own(&self, at: usize) -> Value {
        self.layer[at].map(|x| f32::from(x) / 255.0)
    }

    /// A known texel in the light of another place.
    fn moved(&self, source: usize, to: usize) -> Value {
        let value = self.own(source);
        let Some(shading) = self.shading else {
            return value;
        };
        let place = |at: usize| [(at % self.width) as f32, (at / self.width) as f32];
        let (from, here) = (shading.at(place(source)), shading.at(place(to)));
        std::array::from_fn(|k| value[k] + here[k] - from[k])
    }

    fn value(&self, at: usize) -> Value {
        if self.known[at] {
            return self.own(at);
        }
        match self.field.source[at] {
            NONE => [0.0; 4],
            source => self.moved(source as usize, at),
        }
    }

    /// What the copy at `at` would show at its neighbour: the texel beside its source, when that is known.
    fn beside(&self, at: usize, neighbour: usize) -> Option<Value> {
        let step = neighbour as i64 - at as i64;
        let source = i64::from(self.field.source[at]) + step;
        let width = self.width as i64;
        let column = i64::from(self.field.source[at]) % width;
        let leaves = (step == 1 && column + 1 == width) || (step == -1 && column == 0);
        let source = usize::try_from(source).ok()?;
        let page = self.field.source.len();
        let leaves = leaves || source / page != self.field.source[at] as usize / page;
        let known = !leaves && *self.known.get(source)?;
        known.then(|| self.moved(source, neighbour))
    }

    /// The equation of the correction over a cut whose values are `values`.
    fn equation(&self, cut: &Cut, values: &[Value]) -> Equation {
        let mut equation = Equation::new(cut.width, cut.height);
        let at = |k: usize| cut.texel(k, self.width);
        let copied = |k: usize| self.field.source[at(k)] != NONE;
        for k in 0..cut.len() {
            equation.free[k] = copied(k);
        }
        let mut edge = |k: usize, other: usize, down: bool| {
            let (here, there) = (at(k), at(other));
            let known = [k, other].map(|k| self.known[at(k)]);
            let free = [copied(k), copied(other)];
            let shown = [free[0] || known[0], free[1] || known[1]];
            if free == [false; 2] || shown != [true; 2] {
                return;
            }
            if free[0] && free[1] {
                let weights = if down {
                    &mut equation.below
                } else {
                    &mut equation.right
                };
                weights[k] = 1.0;
                let step = there as i64 - here as i64;
                if i64::from(self.field.source[there]) - i64::from(self.field.source[here]) == step
                {
                    return;
                }
            } else {
                equation.fixed[if free[0] { k } else { other }] += 1.0;
            }
            // The step from here to there as each copy has it.
            let own = free[0].then(|| self.beside(here, there)).flatten();
            let others = free[1].then(|| self.beside(there, here)).flatten();
            let (a, b) = (values[k], values[other]);
            for c in 0..4 {
                let steps = [own.map(|v| a[c] - v[c]), others.map(|v| v[c] - b[c])];
                let count = steps.iter().flatten().count().max(1) as f32;
                let step = steps.iter().flatten().sum::<f32>() / count;
                let wanted = (step - (a[c] - b[c])).clamp(-MOST_STEP, MOST_STEP);
                if free[0] {
                    equation.wanted[k][c] += wanted;
                }
                if free[1] {
                    equation.wanted[other][c] -= wanted;
                }
            }
        };
        for k in 0..cut.len() {
            if (k + 1) % cut.width != 0 {
                edge(k, k + 1, false);
            }
            if k + cut.width < cut.len() {
                edge(k, k + cut.width, true);
            }
        }
        equation
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Settings;
    use crate::labels::choose;
    use crate::search::search;
    use crate::testset::{Fabric, Family, Layout, TestScan};

    #[test]
    fn every_texel_on_both_sides_of_a_fold_has_a_source() {
        let budget = Budget::unlimited();
        for seed in 1..7 {
            let scan = TestScan::of(Family::Sibling(seed), Fabric::Border, Layout::Mirrored, 71);
            let cloth = scan.cloth();
            let mut gathered =
                Gathered::new(&cloth, &scan.patch, &Settings::default(), budget).unwrap();
            let found = search(&mut gathered, budget).unwrap();
            let raster = gathered.raster();
            let labelling = choose(&raster, &found.candidates, found.unserved, budget).unwrap();
            let field = Field::new(&gathered, &labelling, budget).unwrap();
            let is_open = |at: &usize| gathered.missing[*at] && !gathered.known[*at];
            let open = (0..raster.hole.len()).filter(is_open);
            let without = open.filter(|at| field.source[*at] == NONE).count();
            assert_eq!(without, 0, "{seed}");
        }
    }
}
