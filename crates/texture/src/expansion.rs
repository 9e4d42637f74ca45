//! One label for each site of the hole, so that the seams between labels and at the rim are seen least: α-expansion (Boykov, Veksler and Zabih 2001) of
//! He and Sun's energy.
//!
//! A site is a square of places. A seam between two sites costs how much the two copies differ at the places along it; a site at the rim costs how much
//! its copy differs from the cloth there.

use darn_budget::{Budget, Exhausted};
use rayon::prelude::*;

use crate::features::{Feature, distance};
use crate::flow::Graph;
use crate::offsets::{Candidate, Known};

/// Places along a site's side.
const SIDE: usize = 3;
/// Cost of a place that a label does not serve, against one without a label.
const MISSING: f32 = 8.0;
/// Weight of what offsets promise over all of the cloth.
const PRIOR: f32 = 0.3;
/// Sweeps over all labels.
const SWEEPS: usize = 2;
/// Costs in the cut's whole numbers.
const UNIT: f32 = 4096.0;
/// Nanoseconds of work for a site and a label in a sweep, and for a place and a label.
const SITE_WORK: u64 = 400;
const PLACE_WORK: u64 = 12;

/// Two open neighbours: a site, which of its borders, and the site beyond.
type Pair = (usize, usize, usize);

/// Sites of the places, row by row, and what each label shows at each place.
pub(crate) struct Sites {
    columns: usize,
    rows: usize,
    /// Per place: its site.
    of_place: Vec<usize>,
    /// Per site: whether it has a place of the hole.
    open: Vec<bool>,
    /// Per label and place: the copy; `None` when it is not known.
    shown: Vec<Vec<Option<Feature>>>,
    /// Per site, for the sites to the right and below: places along the border.
    borders: [Vec<Vec<usize>>; 2],
    /// Per site and label.
    own: Vec<Vec<f32>>,
    /// The difference that counts for copies that are not known.
    unknown: f32,
}

/// The places to be labelled.
pub(crate) struct Field<'a> {
    pub raster: &'a Known<'a>,
    pub texels: &'a [usize],
    pub columns: usize,
    pub candidates: &'a [Candidate],
    /// Mean squared difference of unrelated places.
    pub unserved: f32,
}

impl Sites {
    pub(crate) fn new(field: &Field, budget: &Budget) -> Result<Sites, Exhausted> {
        let Field {
            raster,
            texels,
            columns,
            candidates,
            unserved,
        } = *field;
        budget.spend(PLACE_WORK * (texels.len() * candidates.len()) as u64)?;
        let place_rows = texels.len() / columns;
        let (across, down) = (columns.div_ceil(SIDE), place_rows.div_ceil(SIDE));
        let of_place: Vec<usize> = (0..texels.len())
            .map(|p| p / columns / SIDE * across + p % columns / SIDE)
            .collect();
        let mut open = vec![false; across * down];
        for (place, site) in of_place.iter().enumerate() {
            open[*site] |= raster.hole[texels[place]];
        }
        let copy = |c: &Candidate| -> Vec<Option<Feature>> {
            let of = |at: &usize| raster.source(*at, c.offset).map(|s| raster.features[s]);
            texels.iter().map(of).collect()
        };
        let mut borders = [
            vec![Vec::new(); across * down],
            vec![Vec::new(); across * down],
        ];
        for place in 0..texels.len() {
            for (k, step) in [(0, 1), (1, columns)] {
                let other = place + step;
                let last_column = k == 0 && (place + 1) % columns == 0;
                if !last_column && other < texels.len() && of_place[other] != of_place[place] {
                    borders[k][of_place[place]].extend([place, other]);
                }
            }
        }
        let mut sites = Sites {
            columns: across,
            rows: down,
            of_place,
            open,
            shown: candidates.par_iter().map(copy).collect(),
            borders,
            own: Vec::new(),
            unknown: (0.5 * unserved).sqrt(),
        };
        sites.own = (0..across * down)
            .into_par_iter()
            .map(|site| sites.own_costs(site, field))
            .collect();
        Ok(sites)
    }

    fn own_costs(&self, site: usize, field: &Field) -> Vec<f32> {
        if !self.open[site] {
            return Vec::new();
        }
        let columns = field.columns;
        let rows = field.texels.len() / columns;
        let (left, top) = (site % self.columns * SIDE, site / self.columns * SIDE);
        let range = |from: usize, end: usize| from.saturating_sub(1)..(from + SIDE + 1).min(end);
        let around: Vec<usize> = range(top, rows)
            .flat_map(|r| range(left, columns).map(move |c| r * columns + c))
            .collect();
        let cost = |(shown, candidate): (&Vec<Option<Feature>>, &Candidate)| {
            let mut cost = PRIOR * candidate.difference.sqrt();
            for place in &around {
                let texel = field.texels[*place];
                if field.raster.known[texel] {
                    let own = field.raster.features[texel];
                    cost += shown[*place]
                        .map_or(0.7 * self.unknown, |other| distance(own, other).sqrt());
                } else if self.of_place[*place] == site
                    && field.raster.hole[texel]
                    && shown[*place].is_none()
                {
                    cost += MISSING * self.unknown;
                }
            }
            cost
        };
        self.shown.iter().zip(field.candidates).map(cost).collect()
    }

    /// How much two labels differ along the border of a site and the next one.
    fn seam(&self, (site, down): (usize, usize), a: u8, b: u8) -> f32 {
        if a == b {
            return 0.0;
        }
        let (a, b) = (&self.shown[a as usize], &self.shown[b as usize]);
        let at = |place: &usize| match (a[*place], b[*place]) {
            (Some(a), Some(b)) => distance(a, b).sqrt(),
            _ => self.unknown,
        };
        self.borders[down][site].iter().map(at).sum()
    }

    /// Pairs of open neighbours: site, which border, neighbour.
    fn pairs(&self) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for site in 0..self.open.len() {
            let right = (site + 1) % self.columns != 0;
            let below = site / self.columns + 1 < self.rows;
            for (down, there, other) in [(0, right, site + 1), (1, below, site + self.columns)] {
                if there && self.open[site] && self.open[other] {
                    pairs.push((site, down, other));
                }
            }
        }
        pairs
    }

    fn energy(&self, labels: &[u8], pairs: &[Pair]) -> f64 {
        let own = |site: usize| {
            if self.open[site] {
                self.own[site][labels[site] as usize]
            } else {
                0.0
            }
        };
        let sites: f64 = (0..labels.len()).map(|s| f64::from(own(s))).sum();
        let seam = |(site, down, other): &Pair| {
            f64::from(self.seam((*site, *down), labels[*site], labels[*other]))
        };
        sites + pairs.iter().map(seam).sum::<f64>()
    }

    /// The label of every place.
    pub(crate) fn labels(&self, budget: &Budget) -> Result<Vec<u8>, Exhausted> {
        let pairs = self.pairs();
        let count = self.shown.len();
        let cheapest = |site: usize| {
            let costs = &self.own[site];
            (0..costs.len())
                .min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
                .unwrap_or(0) as u8
        };
        let mut labels: Vec<u8> = (0..self.open.len()).map(cheapest).collect();
        let mut energy = self.energy(&labels, &pairs);
        let mut seams = self.seams(&labels, &pairs);
        for _ in 0..SWEEPS {
            let before = energy;
            for label in 0..count as u8 {
                budget.spend(SITE_WORK * self.open.len() as u64)?;
                let next = self.expanded(&labels, label, &pairs, &seams);
                if next == labels {
                    continue;
                }
                let lower = self.energy(&next, &pairs);
                if lower < energy {
                    (labels, energy) = (next, lower);
                    seams = self.seams(&labels, &pairs);
                }
            }
            if energy >= before {
                break;
            }
        }
        Ok(self.of_place.iter().map(|site| labels[*site]).collect())
    }

    /// What the seam of each pair costs.
    fn seams(&self, labels: &[u8], pairs: &[Pair]) -> Vec<f32> {
        let seam =
            |(site, down, other): &Pair| self.seam((*site, *down), labels[*site], labels[*other]);
        pairs.iter().map(seam).collect()
    }

    /// The best labelling in which any site keeps its label or takes this one.
    fn expanded(&self, labels: &[u8], label: u8, pairs: &[Pair], seams: &[f32]) -> Vec<u8> {
        let whole = |x: f32| (UNIT * x) as i64;
        let mut leans: Vec<i64> = (0..labels.len())
            .map(|site| {
                let own = &self.own[site];
                if own.is_empty() {
                    0
                } else {
                    whole(own[label as usize]) - whole(own[labels[site] as usize])
                }
            })
            .collect();
        let mut graph = Graph::new(labels.len());
        for ((site, down, other), stay) in pairs.iter().zip(seams) {
            let seam = |a: u8, b: u8| whole(self.seam((*site, *down), a, b));
            let (a, b) = (labels[*site], labels[*other]);
            let (stay, second, first) = (whole(*stay), seam(a, label), seam(label, b));
            leans[*site] += first - stay;
            leans[*other] -= first;
            let capacity = (second + first - stay).max(0);
            graph.connect(
                *site,
                *other,
                u32::try_from(capacity).unwrap_or(u32::MAX / 4),
            );
        }
        leans
            .iter()
            .enumerate()
            .for_each(|(site, lean)| graph.lean(site, *lean));
        let taken = graph.cut();
        (labels.iter().zip(taken))
            .map(|(old, taken)| if taken { label } else { *old })
            .collect()
    }
}
