//! The cloth around a hole, laid flat.

use darn_contract::v1;
use darn_geometry::flatten::Chart;
use darn_geometry::mesh::Vec2;
use darn_geometry::mesh::index::LoopId;
use darn_geometry::mesh::region::Region;

/// The cloth around a hole, laid flat.
#[derive(Clone)]
pub struct FlatRegion {
    /// The region.
    pub region: Region,
    /// The region without the scanner's noise, where there is some.
    pub smooth: Option<Region>,
    /// The region's layout in the plane.
    pub chart: Chart,
    /// The borders of the islands in it, as loops of the scan.
    pub islands: Vec<LoopId>,
    /// Milliseconds of growing and flattening it.
    pub timings: v1::HoleTimings,
}

impl FlatRegion {
    /// The region as the chart shows it: without the scanner's noise.
    pub fn seen(&self) -> &Region {
        self.smooth.as_ref().unwrap_or(&self.region)
    }

    /// The rim on the chart's unit square.
    pub fn rim_uv(&self) -> Vec<Vec2> {
        let rim = self.region.rim.iter();
        rim.map(|v| self.chart.uv(*v)).collect()
    }
}
