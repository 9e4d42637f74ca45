//! `darn render`: a picture of a scan; reconstructed cloth has another colour, or that of its confidence, or all has the scan's own.

use super::confidence_paint::ConfidencePaint;
use super::failure::{Failure, OrFail};
use super::files;
use super::scan_paint::ScanPaint;
use crate::settings::{DeadlineArgs, SizeArgs};
use darn_geometry::mesh::index::FaceId;
use darn_geometry::mesh::weld::WeldedMesh;
use darn_geometry::mesh::{Vec3, weld};
use darn_gltf_scan::Scan;
use darn_render::{
    CLOTH, CameraDirection, EdgeLines, FacePlace, Framing, MAX_SIDE, MENDED, PictureOptions,
    painted, picture,
};
use image::{ImageFormat, RgbImage};
use std::io::Cursor;
use std::path::PathBuf;

#[derive(Debug, clap::Args)]
pub struct RenderArgs {
    /// The scan: GLB; glTF, with its files beside it; or a zip of those
    scan: PathBuf,
    /// Where the picture goes, as PNG
    #[arg(short, long)]
    output: PathBuf,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1200x900", value_parser = size)]
    size: [u32; 2],
    /// Camera's azimuth about +y and elevation, in degrees; by default the cloth's broad side
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = numbers::<2>, allow_hyphen_values = true)]
    view: Option<[f64; 2]>,
    /// Look at a ball only: its centre and radius
    #[arg(long, value_name = "X,Y,Z,RADIUS", value_parser = numbers::<4>, allow_hyphen_values = true)]
    focus: Option<[f64; 4]>,
    /// Draw every edge, not only boundaries
    #[arg(long)]
    wireframe: bool,
    /// Draw the scan's own colours, without its lights and normal maps
    #[arg(long)]
    colours: bool,
    /// Draw the scan's own colours in this material variant, such as "Reconstruction marked"
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Draw reconstructed cloth by how far it may be off: from yellow, certain, to dark violet
    #[arg(long, conflicts_with_all = ["colours", "variant"])]
    confidence: bool,
    #[command(flatten)]
    limits: SizeArgs,
    #[command(flatten)]
    deadline: DeadlineArgs,
}

/// Runs `darn render`.
pub fn run(args: &RenderArgs) -> Result<(), Failure> {
    let budget = args.deadline.budget();
    let scan = files::read_scan(&args.scan, &args.limits, &budget)?;
    let welded = weld::weld_within(&scan.surface, &|_| 0.0, &budget);
    let welded = welded.or_fail(format!("weld {}", args.scan.display()))?;
    let image = match (args.colours || args.variant.is_some(), args.confidence) {
        (true, _) => coloured(&scan, &welded, args)?,
        (false, true) => confident(&scan, &welded, args)?,
        (false, false) => {
            let faces = welded.soup_faces.iter();
            let tints: Vec<[u8; 3]> = faces.map(|face| tint(&scan, face)).collect();
            picture(&welded.mesh, &tints, &args.options())
        }
    };
    budget.check().or_fail("draw the picture")?;
    let mut png = Cursor::new(Vec::new());
    image
        .write_to(&mut png, ImageFormat::Png)
        .or_fail("encode the picture")?;
    files::write(&args.output, &png.into_inner())
}

/// The picture in the scan's own colours.
fn coloured(scan: &Scan, welded: &WeldedMesh, args: &RenderArgs) -> Result<RgbImage, Failure> {
    let variant =
        match &args.variant {
            Some(name) => Some(scan.variant(name).ok_or_else(|| {
                Failure::Usage(format!("the scan has no material variant {name:?}"))
            })?),
            None => None,
        };
    let paint = ScanPaint::new(scan, variant, &args.limits.limits());
    let at = |place: &FacePlace| {
        let face = FaceId(place.face as u32);
        let part = (welded.soup_faces.of(face)).and_then(|own| scan.part_of_face(own));
        let corners = welded.soup_corners(&scan.surface, face);
        match part.zip(corners) {
            Some((part, corners)) => paint.at(part, corners, place.weights),
            None => [1.0; 3],
        }
    };
    Ok(painted(&welded.mesh, &at, &args.options()))
}

/// The picture of the confidence in reconstructed cloth; says what the darkest colour means.
fn confident(scan: &Scan, welded: &WeldedMesh, args: &RenderArgs) -> Result<RgbImage, Failure> {
    let paint = ConfidencePaint::new(scan).ok_or_else(|| {
        let reason = "no reconstructed cloth of the scan says how far it may be off (_CONFIDENCE)";
        Failure::Usage(reason.into())
    })?;
    println!(
        "{}: from yellow, as scanned, to dark violet, a standard deviation of {} (in the scene's unit)",
        args.output.display(),
        paint.most
    );
    let at = |place: &FacePlace| {
        let face = FaceId(place.face as u32);
        let part = (welded.soup_faces.of(face)).and_then(|own| scan.part_of_face(own));
        match part.zip(welded.soup_corners(&scan.surface, face)) {
            Some((part, corners)) => paint.at(part, corners, place.weights),
            None => [1.0; 3],
        }
    };
    Ok(painted(&welded.mesh, &at, &args.options()))
}

impl RenderArgs {
    fn options(&self) -> PictureOptions {
        PictureOptions {
            size: self.size,
            direction: match self.view {
                Some([azimuth, elevation]) => CameraDirection::Angles { azimuth, elevation },
                None => CameraDirection::Auto,
            },
            framing: match self.focus {
                Some([x, y, z, radius]) => Framing::Focus {
                    centre: Vec3::new(x, y, z),
                    radius,
                },
                None => Framing::Whole,
            },
            lines: if self.wireframe {
                EdgeLines::Wireframe
            } else {
                EdgeLines::Rims
            },
        }
    }
}

/// The colour of a face of the scan's surface: one for scanned cloth, one for reconstructed cloth.
fn tint(scan: &Scan, face: u32) -> [u8; 3] {
    let part = scan
        .part_of_face(face)
        .and_then(|part| scan.parts.get(part));
    if part.is_some_and(|part| part.reconstructed) {
        MENDED
    } else {
        CLOTH
    }
}

/// Width and height in pixels, as in 1200x900.
fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text
        .split_once('x')
        .ok_or("expected WIDTHxHEIGHT, such as 1200x900")?;
    let side = |side: &str| match side.parse() {
        Ok(pixels) if (1..=MAX_SIDE).contains(&pixels) => Ok(pixels),
        _ => Err(format!(
            "{side:?} is not a whole number from 1 to {MAX_SIDE}"
        )),
    };
    Ok([side(width)?, side(height)?])
}

/// `N` finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let all: Result<Vec<f64>, _> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>())
        .collect();
    let all = all.ok().filter(|all| all.iter().all(|x| x.is_finite()));
    all.and_then(|all| all.try_into().ok())
        .ok_or_else(|| format!("expected {N} numbers with commas between them"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!(size("1200x900"), Ok([1200, 900]));
        for wrong in ["1200", "0x9", "axb", "9x99999999", "-1x4"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn numbers_are_counted() {
        assert_eq!(numbers::<2>("-30, 45.5"), Ok([-30.0, 45.5]));
        for wrong in ["1", "1,2,3", "1,x", "nan,1", "inf,0"] {
            assert!(numbers::<2>(wrong).is_err(), "{wrong}");
        }
    }
}
