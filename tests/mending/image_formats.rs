//! The images of scans: those that are read, and those that cannot be.

use darn_contract::TextureChoice;
use darn_texture::testset::{Fabric, Layout, TestScan};
use serde_json::json;

use super::colours::patched;
use super::patched::{data_uri, edited, fabric, png};

#[test]
fn images_that_cannot_be_read_leave_the_texture_continued_and_say_so() {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    let bytes = fabric(&sheet);
    // The head of a PNG of 60,000 × 60,000 texels; a header alone.
    let mut bomb = png(4, &[[0; 4]; 16]);
    bomb[16..24].copy_from_slice(&[0, 0, 0xEA, 0x60, 0, 0, 0xEA, 0x60]);
    let crc = crc(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    for (image, why) in [
        (bomb, "max_image_texels"),
        (b"\xABKTX 20\xBB\r\n\x1A\n".to_vec(), "PNG, JPEG or WebP"),
        (png(4, &[[0; 4]; 16])[..60].to_vec(), "/images/0"),
    ] {
        let broken = edited(&bytes, |json| {
            json["images"][0] = json!({ "uri": data_uri(&image) })
        });
        for choice in [None, Some(TextureChoice::Flat)] {
            let own = patched(&broken, choice);
            assert_eq!(own.report.method, "continued");
            assert!(own.report.reason.contains(why), "{}", own.report.reason);
            let told = own.notes.iter().any(|note| note.contains(why));
            assert!(told, "{:?}", own.notes);
        }
        // Who asks for it is told of nothing else.
        let asked = patched(&broken, Some(TextureChoice::Continue));
        assert!(!asked.notes.iter().any(|note| note.contains(why)));
    }
    let unknown = edited(&bytes, |json| {
        json["materials"][0]["extensions"] =
            json!({"ACME_glitter": {"glitterTexture": {"index": 0}}});
    });
    let own = patched(&unknown, None);
    assert!(
        own.report
            .reason
            .contains("/materials/0/extensions/ACME_glitter/glitterTexture")
    );
}

/// A sheet's image in another format.
fn encoded(sheet: &TestScan, format: image::ImageFormat) -> Vec<u8> {
    let side = sheet.side as u32;
    let bytes = sheet.texels.iter().flatten().copied().collect();
    let picture = image::RgbaImage::from_raw(side, side, bytes).expect("all texels");
    let picture = image::DynamicImage::from(picture).into_rgb8();
    let mut out = std::io::Cursor::new(Vec::new());
    match format {
        image::ImageFormat::Jpeg => {
            let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut out, 95);
            picture.write_with_encoder(encoder).expect("a JPEG");
        }
        format => picture.write_to(&mut out, format).expect("an image"),
    }
    out.into_inner()
}

#[test]
fn the_fabric_of_jpeg_and_webp_images_goes_on() {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    for (kind, format) in [
        ("image/jpeg", image::ImageFormat::Jpeg),
        ("image/webp", image::ImageFormat::WebP),
    ] {
        let image = encoded(&sheet, format);
        let bytes = edited(&fabric(&sheet), |json| {
            json["images"][0] = json!({ "uri": data_uri(&image), "mimeType": kind });
            if kind == "image/webp" {
                json["extensionsUsed"] = json!(["EXT_texture_webp"]);
                json["textures"][0] = json!({"extensions": {"EXT_texture_webp": {"source": 0}}});
            }
        });
        let own = patched(&bytes, None);
        assert_eq!(own.report.method, "synthesized", "{kind}: {:?}", own.report);
        let share = own.share_right(&sheet);
        assert!(share > 0.9, "{kind}: {share}");
    }
}

/// The checksum of a PNG chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| {
            (c >> 1) ^ (0xEDB8_8320 * (c & 1))
        })
    })
}
