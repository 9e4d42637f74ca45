//! Pieces of cloth at a rim that stand out of the surface: flaps that are shorter than the hole is wide, the corner of a three-cornered tear, a rim that
//! has curled.
//!
//! Laid flat, such a piece lies where it was torn from. Cloth does not stretch, so where it was whole no two points of a rim are farther apart in space
//! than on the chart. Of two that are, the one belongs to the piece that departs more from a smooth surface over the hole and the cloth next to it, which
//! starts in the cloth farther out.

use darn_budget::{Budget, Exhausted, Steps};

use super::smooth_sheet::SmoothSheet;
use crate::flatten::Chart;
use crate::mesh::index::FaceId;
use crate::mesh::region::Region;
use crate::mesh::{Vec2, Vec3};

/// Two points of a rim are apart when their distance in space exceeds that on the chart by this factor,
const APART: f64 = 1.08;
/// and by this many mean edges of the rim.
const APART_EDGES: f64 = 1.5;
/// Mean stretch of a chart from which on its distances tell nothing of what was whole: cloth that does not lie flat looks torn there.
/// On 126 scans of garments and sheets with sound holes, no rim looks torn on charts that are flatter; with 4 % instead of 8 above, two do.
const LIES_FLAT: f64 = 1.015;
/// Fewer points of the rim with such a partner are no piece that stands out.
const FEWEST: usize = 3;
/// Points of the rim that are compared with all others, about.
const PARTNERS: usize = 200;
/// How far the smooth surface starts from the rim, in shares of the hole's width on the chart. Of those that tell where the pieces end, the one with the
/// smaller pieces is right.
const STARTS: [f64; 2] = [0.25, 0.5];
/// Of two points that are apart, one is blamed that departs by more than this many mean edges of the rim
const DEPARTS: f64 = 1.0;
/// and by more than this share of what the other does: where all of a rim has curled, both are to blame.
const BLAMED: f64 = 0.8;
/// A piece ends where it departs by less than this many mean edges of the rim,
const ENDS: f64 = 0.4;
/// and by less than this many times the median of the rim that is not blamed: the cloth's own folds depart, too.
const FOLDS: f64 = 2.0;
/// Largest share of the points with a partner that may still be apart when the pieces are gone.
const STILL_APART: f64 = 0.1;
/// Rings of faces at the end of a piece that are left with it: the bend of its hinge.
const BEND: usize = 1;
/// Most rings of a piece, …
const MAX_RINGS: usize = 80;
/// … and of its end, at least; at most as many as before.
const END_RINGS: usize = 4;
/// Nanoseconds of work a pair of points.
const PAIR_WORK: u64 = 4;

/// Whether a chart's distances tell what of a rim was whole.
pub fn lies_flat(chart: &Chart) -> bool {
    chart.stretch_mean <= LIES_FLAT
}

/// Whether some of a region's rim stands out of the surface, as far as the chart tells.
///
/// # Errors
/// `Exhausted`.
pub fn stands_out(region: &Region, chart: &Chart, budget: &Budget) -> Result<bool, Exhausted> {
    if !lies_flat(chart) {
        return Ok(false);
    }
    let mut rim = region.rim.clone();
    rim.sort_unstable();
    rim.dedup();
    let found = apart(region, chart, &rim, budget)?;
    Ok(found.len() >= FEWEST)
}

/// Mean edge of a region's rim, scene units.
fn mean_edge(region: &Region) -> f64 {
    let count = region.rim.len();
    let place = |k: usize| region.mesh.positions[region.rim[k % count] as usize];
    let length: f64 = (0..count).map(|k| (place(k + 1) - place(k)).norm()).sum();
    length / count.max(1) as f64
}

/// Of some vertices, ascending, those that are farther from another one in space than cloth can be, each with all of these partners, of a selection.
///
/// # Errors
/// `Exhausted`.
fn apart(
    region: &Region,
    chart: &Chart,
    rim: &[u32],
    budget: &Budget,
) -> Result<Vec<(u32, Vec<u32>)>, Exhausted> {
    let partners: Vec<u32> = (rim.iter())
        .step_by((rim.len() / PARTNERS).max(1))
        .copied()
        .collect();
    budget.spend(PAIR_WORK * (rim.len() * partners.len()) as u64)?;
    let (flat, space) = (&chart.flat, &region.mesh.positions);
    let least = APART_EDGES * mean_edge(region);
    let is_apart = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        let most = APART * (flat[a] - flat[b]).norm() + least;
        (space[a] - space[b]).norm_squared() > most * most
    };
    let with_partners = rim.iter().map(|v| {
        let all = partners.iter().filter(|w| is_apart(*v, **w));
        (*v, all.copied().collect::<Vec<u32>>())
    });
    Ok(with_partners.filter(|(_, all)| !all.is_empty()).collect())
}

/// The faces of the pieces at a region's rim that stand out of the surface, ascending; empty where none does, or where it cannot be told which.
///
/// # Errors
/// `Exhausted`.
pub fn standing_pieces(
    region: &Region,
    chart: &Chart,
    budget: &Budget,
) -> Result<Vec<FaceId>, Exhausted> {
    let mut least: Option<Vec<u32>> = None;
    for start in STARTS {
        let mut peeling = Peeling::new(region, chart);
        let Some(sheet) = peeling.smooth_sheet(start, budget)? else {
            continue;
        };
        if let Some(found) = peeling.peeled(&sheet, budget)?
            && least.as_ref().is_none_or(|least| found.len() < least.len())
        {
            least = Some(found);
        }
    }
    let least = least.unwrap_or_default();
    let mut found: Vec<FaceId> = least.iter().map(|f| region.faces[*f as usize]).collect();
    found.sort_unstable();
    Ok(found)
}

/// A region from whose rim rings of faces are taken.
struct Peeling<'a> {
    region: &'a Region,
    chart: &'a Chart,
    /// Mean edge of the rim, scene units.
    edge: f64,
    /// Per vertex its faces.
    around: Vec<Vec<u32>>,
    /// Per face whether it was taken.
    taken: Vec<bool>,
    /// Per vertex whether it is of the rim, or of what the rim has become.
    at_rim: Vec<bool>,
}

impl<'a> Peeling<'a> {
    fn new(region: &'a Region, chart: &'a Chart) -> Peeling<'a> {
        let mesh = &region.mesh;
        let mut around = vec![Vec::new(); mesh.positions.len()];
        for (f, face) in (0u32..).zip(&mesh.faces) {
            face.iter().for_each(|v| around[*v as usize].push(f));
        }
        let mut at_rim = vec![false; mesh.positions.len()];
        region.rim.iter().for_each(|v| at_rim[*v as usize] = true);
        Peeling {
            region,
            chart,
            edge: mean_edge(region),
            around,
            taken: vec![false; mesh.faces.len()],
            at_rim,
        }
    }

    /// The vertices of the rim that it has now.
    fn rim(&self) -> Vec<u32> {
        let all = 0..self.at_rim.len() as u32;
        all.filter(|v| self.at_rim[*v as usize]).collect()
    }

    /// A smooth surface through the cloth that is farther from the rim on the chart than this share of the hole's width; `None` where there is too little.
    ///
    /// # Errors
    /// `Exhausted`.
    fn smooth_sheet(&self, start: f64, budget: &Budget) -> Result<Option<SmoothSheet>, Exhausted> {
        let rim: Vec<Vec2> = (self.region.rim.iter())
            .map(|v| self.chart.flat[*v as usize])
            .collect();
        let far = start * crate::polygon::extent(&rim);
        let flat = &self.chart.flat;
        budget.spend(PAIR_WORK * (rim.len() * flat.len()) as u64)?;
        let is_far = |p: &Vec2| rim.iter().all(|q| (p - q).norm_squared() >= far * far);
        let known: Vec<(Vec2, Vec3)> = (flat.iter().zip(&self.region.mesh.positions))
            .filter(|(p, _)| is_far(p))
            .map(|(p, place)| (*p, *place))
            .collect();
        SmoothSheet::through(&known, budget)
    }

    /// Takes the pieces that stand out; their faces, `None` where nothing stands out or the rest does.
    ///
    /// # Errors
    /// `Exhausted`.
    fn peeled(
        &mut self,
        sheet: &SmoothSheet,
        budget: &Budget,
    ) -> Result<Option<Vec<u32>>, Exhausted> {
        let departure: Vec<f64> = (self.chart.flat.iter().zip(&self.region.mesh.positions))
            .map(|(flat, place)| (sheet.at(flat) - place).norm())
            .collect();
        let departs = |v: u32| departure[v as usize];
        let (mut first, mut steps) = (None, Steps::of(budget));
        let mut blamed_ever = vec![false; departure.len()];
        let mut rings = 0;
        while rings < MAX_RINGS {
            let apart = apart(self.region, self.chart, &self.rim(), budget)?;
            let before = *first.get_or_insert(apart.len());
            if before < FEWEST {
                return Ok(None);
            }
            let mut blamed: Vec<u32> = Vec::new();
            for (v, partners) in &apart {
                steps.take(PAIR_WORK * partners.len() as u64)?;
                let least = partners
                    .iter()
                    .map(|w| departs(*w))
                    .fold(f64::MAX, f64::min);
                let most = DEPARTS * self.edge;
                if departs(*v) > most && departs(*v) > BLAMED * least {
                    blamed.push(*v);
                }
            }
            if blamed.is_empty() {
                if apart.len() as f64 > STILL_APART * before as f64 {
                    return Ok(None);
                }
                break;
            }
            rings += 1;
            for v in blamed {
                blamed_ever[v as usize] = true;
                self.take_around(v);
            }
        }
        let most = END_RINGS.max(rings);
        let ends = self.ends(&departure, &blamed_ever);
        for _ in 0..most {
            if !self.take_ring(|v| departs(v) > ends) {
                break;
            }
        }
        for _ in 0..BEND {
            self.take_ring(|_| true);
        }
        let taken: Vec<u32> = (0..self.taken.len() as u32)
            .filter(|f| self.taken[*f as usize])
            .collect();
        let is_small = !taken.is_empty() && 2 * taken.len() < self.taken.len();
        Ok(is_small.then_some(taken))
    }

    /// By how much a piece departs where it ends: less than the rest of the rim does, as a rule.
    fn ends(&self, departure: &[f64], blamed: &[bool]) -> f64 {
        let sound = self.region.rim.iter().filter(|v| !blamed[**v as usize]);
        let mut sound: Vec<f64> = sound.map(|v| departure[*v as usize]).collect();
        sound.sort_unstable_by(f64::total_cmp);
        let folds = match 2 * sound.len() > self.region.rim.len() {
            true => FOLDS * sound[sound.len() / 2],
            false => 0.0,
        };
        folds.max(ENDS * self.edge)
    }

    /// Takes the faces at the vertices where a piece ends, of those that are chosen; whether there are any.
    fn take_ring(&mut self, chosen: impl Fn(u32) -> bool) -> bool {
        let ends = |v: &u32| {
            let faces = &self.around[*v as usize];
            let taken = faces.iter().filter(|f| self.taken[**f as usize]).count();
            taken > 0 && taken < faces.len() && chosen(*v)
        };
        let ends: Vec<u32> = self.rim().into_iter().filter(ends).collect();
        ends.iter().for_each(|v| self.take_around(*v));
        !ends.is_empty()
    }

    /// Takes the faces at a vertex.
    fn take_around(&mut self, vertex: u32) {
        for f in &self.around[vertex as usize] {
            self.taken[*f as usize] = true;
            for v in self.region.mesh.faces[*f as usize] {
                self.at_rim[v as usize] = true;
            }
        }
        self.at_rim[vertex as usize] = false;
        for f in &self.around[vertex as usize] {
            for v in self.region.mesh.faces[*f as usize] {
                let mut faces = self.around[v as usize].iter();
                if faces.all(|f| self.taken[*f as usize]) {
                    self.at_rim[v as usize] = false;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::flatten::{FlattenLimits, flatten};
    use crate::mesh::TriMesh;
    use crate::mesh::region::{Region, region_around_hole};
    use crate::mesh::shapes::{flap, jitter, sheet, three_cornered_tear, tongue};
    use crate::mesh::weld::weld;

    fn charted(soup: &TriMesh, reach: f64) -> (Arc<TriMesh>, Region, Chart) {
        let mesh = weld(soup).mesh;
        let region = region_around_hole(&mesh, reach);
        let chart = flatten(&region, &FlattenLimits::default(), Budget::unlimited());
        (mesh, region, chart.expect("a chart"))
    }

    /// The middles of the faces found, and of those not found.
    fn found_and_rest(soup: &TriMesh, reach: f64) -> (Vec<Vec3>, Vec<Vec3>) {
        let (mesh, region, chart) = charted(soup, reach);
        let found = match stands_out(&region, &chart, Budget::unlimited()).expect("no limits") {
            true => standing_pieces(&region, &chart, Budget::unlimited()).expect("no limits"),
            false => Vec::new(),
        };
        let middle = |f: usize| mesh.triangle(f).iter().sum::<Vec3>() / 3.0;
        let all = 0..mesh.faces.len();
        let (found, rest): (Vec<usize>, Vec<usize>) =
            all.partition(|f| found.contains(&FaceId(*f as u32)));
        let middles = |faces: Vec<usize>| faces.into_iter().map(middle).collect();
        (middles(found), middles(rest))
    }

    fn waves(u: f64, v: f64) -> f64 {
        0.03 * (6.0 * u).sin() * (3.0 * v).cos()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10))]

        #[test]
        fn a_short_flap_stands_out_up_to_its_hinge(n in 40usize..60, width in 0.1..0.2f64, length in 0.12..0.2f64, angle in 1.4..2.8f64) {
            let (hinge, soup) = flap(n, [width, length], angle, waves);
            let step = 1.0 / n as f64;
            let (found, rest) = found_and_rest(&soup, 0.4);
            prop_assert!(!found.is_empty());
            for p in &rest {
                prop_assert!((p.z - waves(p.x, p.y)).abs() < 2.5 * step, "a face of the flap at {p:?} is left in the cloth");
            }
            let is_near = |p: &&Vec3| {
                let along = hinge - length - 4.0 * step..hinge + length + 4.0 * step;
                (p.y - 0.5).abs() < 0.5 * width + 4.0 * step && along.contains(&p.x)
            };
            // Some of the rim elsewhere may go with it.
            let near = found.iter().filter(is_near).count();
            prop_assert!(4 * near >= 3 * found.len(), "{} of {} faces are the sheet's", found.len() - near, found.len());
        }

        #[test]
        fn the_corner_of_a_three_cornered_tear_stands_out(n in 40usize..60, leg in 0.15..0.25f64, angle in 0.7..2.8f64) {
            let soup = three_cornered_tear(n, leg, angle, waves);
            let step = 1.0 / n as f64;
            let (found, rest) = found_and_rest(&soup, 0.2);
            prop_assert!(!found.is_empty());
            for p in &rest {
                prop_assert!((p.z - waves(p.x, p.y)).abs() < 3.0 * step, "a face of the corner at {p:?} is left in the cloth");
            }
            // The corner has half of the square's area.
            let most = 2.0 * (0.5 * leg * leg) * (n * n) as f64;
            prop_assert!((found.len() as f64) < 1.6 * most + 40.0, "{} of {most} faces", found.len());
        }

        #[test]
        fn sound_cloth_does_not_stand_out(n in 20usize..40, height in 0.0..0.1f64, noise in 0.0..0.2f64, round in -0.8..0.8f64, seed: u64) {
            let keep = |u: f64, v: f64| (u - 0.5).hypot(v - 0.5) > 0.2;
            let folds = |u: f64, v: f64| Vec3::new(u, v, height * (8.0 * u + v).sin() + round * (u - 0.5) * (v - 0.5));
            let (found, _) = found_and_rest(&jitter(&sheet(n, keep, folds), noise / n as f64, seed), 0.3);
            prop_assert_eq!(found.len(), 0);
        }
    }

    #[test]
    fn a_tongue_in_the_plane_of_the_cloth_does_not_stand_out() {
        assert_eq!(found_and_rest(&tongue(24, 0.05), 0.3).0.len(), 0);
    }
}
