//! The colour of patches: sheets of known fabrics, mended as files, and what a viewer would show where the hole was.

use std::sync::Arc;

use darn_contract::{Constraints, HoleSelector, TextureChoice, v1};
use darn_geometry::mesh::Vec3;
use darn_texture::testset::{Fabric, Layout, TestScan};
use serde_json::json;

use super::cloth::{mended, mender, read};
use super::patched::{
    BEND, Patched, chunks, data_uri, edited, fabric, fabric_at, png, push, push_variant, unbent,
    with_texture,
};

pub fn patched(bytes: &[u8], texture: Option<TextureChoice>) -> Patched {
    Patched::of(&mended(bytes, &with_texture(texture)).expect("one hole"))
}

#[test]
fn on_an_atlas_the_fabric_goes_on() {
    for kind in [Fabric::Twill, Fabric::Stripes, Fabric::Print] {
        let sheet = TestScan::new(kind, Layout::Atlas, 128);
        let bytes = fabric(&sheet);
        let own = patched(&bytes, None);
        assert_eq!(own.report.method, "synthesized", "{}", own.report.reason);
        let share = own.share_right(&sheet);
        assert!(share > 0.9, "{}: {share}", kind.name());
        let continued = patched(&bytes, Some(TextureChoice::Continue));
        assert_eq!(continued.report.method, "continued");
        let share = continued.share_right(&sheet);
        assert!(share < 0.6, "{}: continued {share}", kind.name());
    }
}

#[test]
fn the_patches_of_a_session_come_in_their_own_colours() {
    let sheet = TestScan::new(Fabric::Twill, Layout::Atlas, 128);
    let opening = Constraints::default();
    let never = darn_budget::Budget::unlimited();
    let scan = read(&fabric(&sheet));
    let session = darn_mend::ScanSession::open(scan, &opening, Arc::clone(mender()), never);
    let session = session.expect("one hole");
    let (glb, _) = session.call(never).glb(&opening).expect("a patch");
    let (json, bin) = chunks(&glb);
    let shown = Patched {
        primitive: json["meshes"][0]["primitives"][0].clone(),
        bin: bin.to_vec(),
        report: v1::TextureReport::default(),
        notes: Vec::new(),
        json,
    };
    let share = shown.share_right(&sheet);
    assert!(share > 0.9, "{share}");
    for texture in [TextureChoice::Flat, TextureChoice::None] {
        let asked = with_texture(Some(texture));
        let (glb, report) = session.call(never).glb(&asked).expect("a patch");
        let (json, _) = chunks(&glb);
        let index = &json["meshes"][0]["primitives"][0]["material"];
        let own = &json["materials"][index.as_u64().expect("a material") as usize];
        let (key, done) = ("pbrMetallicRoughness", mended(&fabric(&sheet), &asked));
        let in_file = Patched::of(&done.expect("one hole"));
        assert_eq!(own[key], in_file.material(None)[key]);
        assert_eq!(report.holes[0].texture.as_ref(), Some(&in_file.report));
    }
    let whole = session.call(never).mended(&opening).expect("a scan").bytes;
    assert!(whole == mended(&fabric(&sheet), &opening).expect("one hole").bytes);
}

#[test]
fn where_the_map_goes_on_the_patch_continues_it_and_no_image_is_added() {
    let sheet = TestScan::new(Fabric::Twill, Layout::OneMap, 128);
    let own = patched(&fabric(&sheet), None);
    assert_eq!(own.report.method, "continued");
    assert!(!own.report.reason.is_empty());
    assert!(own.share_right(&sheet) > 0.95);
    // The scan's and the hatch.
    assert_eq!(own.json["images"].as_array().map(Vec::len), Some(2));
    let told = own.notes.iter().any(|note| note.contains("texture"));
    assert!(!told, "{:?}", own.notes);
    let forced = patched(&fabric(&sheet), Some(TextureChoice::Synthesize));
    assert_eq!(forced.report.method, "synthesized");
    assert!(forced.share_right(&sheet) > 0.9);
}

#[test]
fn the_end_of_a_tube_is_closed_in_the_colours_of_its_cloth() {
    for kind in [Fabric::Stripes, Fabric::Print] {
        let sheet = TestScan::new(kind, Layout::Atlas, 128);
        // The rim of the hole is the end of a tube, a sock's without its toe.
        let bytes = fabric_at(&sheet, |[x, y]| {
            let (away, angle) = (x.hypot(y), y.atan2(x));
            Vec3::new(0.64 * angle.cos(), 0.64 * angle.sin(), 0.64 - away / 100.0)
        });
        let places = (0..4096).map(|k| [k % 64, k / 64].map(|c| f64::from(4 * c) - 128.0));
        let fabric: Vec<[f32; 3]> = places.map(|p| sheet.truth(p)).collect();
        let is_of_it = |colour: [u8; 3]| {
            let colour = colour.map(|c| f32::from(c) / 255.0);
            let off = |c: &[f32; 3]| (0..3).map(|k| (c[k] - colour[k]).abs()).fold(0.0, f32::max);
            fabric.iter().any(|known| off(known) < 0.1)
        };
        let mut shares = Vec::new();
        for texture in [None, Some(TextureChoice::Continue)] {
            let asked = Constraints {
                holes: vec![HoleSelector::Near([0.0, 0.0, 0.3])],
                ..with_texture(texture)
            };
            let done = mended(&bytes, &asked).expect("one end");
            assert!(done.report.holes[0].chart.is_none(), "{}", kind.name());
            let own = Patched::of(&done);
            if texture.is_none() {
                assert_eq!(own.report.method, "synthesized", "{}", own.report.reason);
            }
            let shown = own.shown(None);
            let right = shown.iter().filter(|(_, colour)| is_of_it(*colour)).count();
            shares.push(right as f64 / shown.len() as f64);
        }
        // Threads of the weave are mixed where the chart is stretched.
        assert!(shares[0] > 0.9, "{}: {shares:?}", kind.name());
        assert!(shares[1] < 0.5, "{}: {shares:?}", kind.name());
    }
}

#[test]
fn where_the_image_has_nothing_under_the_hole_the_patch_gets_its_own() {
    for kind in [Fabric::Stripes, Fabric::Plaid, Fabric::Print] {
        let mut sheet = TestScan::new(kind, Layout::OneMap, 128);
        // Of all that no triangle shows the image has no more than its mean.
        let middle = sheet.side as f64 / 2.0;
        for (k, texel) in sheet.texels.iter_mut().enumerate() {
            let (x, y) = ((k % sheet.side) as f64, (k / sheet.side) as f64);
            if (x - middle).hypot(y - middle) < 58.0 {
                *texel = [110, 100, 90, 255];
            }
        }
        let own = patched(&fabric(&sheet), None);
        assert_eq!(own.report.method, "synthesized", "{}", kind.name());
    }
}

#[test]
fn the_normals_of_a_map_go_on_in_space() {
    let sheet = TestScan::new(Fabric::Twill, Layout::OneMap, 128);
    // Everywhere leaning to +u.
    let (x, z) = (60.0, 112.0);
    let bytes = edited(&fabric(&sheet), |json| {
        let image = png(4, &[[188, 128, 240, 255]; 16]);
        push(&mut json["images"], json!({ "uri": data_uri(&image) }));
        push(&mut json["textures"], json!({ "source": 1 }));
        json["materials"][0]["normalTexture"] = json!({ "index": 1 });
    });
    let made = patched(&bytes, Some(TextureChoice::Synthesize));
    assert_eq!(made.report.layers, 2);
    let continued = patched(&bytes, Some(TextureChoice::Continue));
    // By half a turn of the map its +u goes along the sheet's −x.
    let turned = edited(&bytes, |json| {
        json["extensionsUsed"] = json!(["KHR_texture_transform"]);
        json["materials"][0]["normalTexture"]["extensions"] =
            json!({"KHR_texture_transform": {"rotation": std::f64::consts::PI}});
    });
    let turned = patched(&turned, Some(TextureChoice::Continue));
    for (own, along_x) in [(made, 1.0), (continued, 1.0), (turned, -1.0)] {
        check_normals(&own, [along_x * x, z]);
    }
}

/// Asserts that the normal map of a patch, the same everywhere, leans by `x` along the flat sheet's x, `z` being along its normal.
fn check_normals(own: &Patched, [x, z]: [f64; 2]) {
    let info = &own.material(None)["normalTexture"];
    let picture = own.picture(info);
    let lean = picture
        .get_pixel(picture.width() / 2, picture.height() / 2)
        .0;
    let lean = [0, 1, 2].map(|k: usize| f64::from(lean[k]) - 128.0);
    let all = own
        .floats::<4>("TANGENT")
        .into_iter()
        .zip(own.floats::<3>("NORMAL"));
    let mut seen = 0;
    for ((tangent, normal), position) in all.zip(own.floats::<3>("POSITION")) {
        let [tx, ty, tz, w] = tangent.map(f64::from);
        let (tangent, normal) = (Vec3::new(tx, ty, tz), Vec3::from(normal.map(f64::from)));
        assert!((tangent.norm() - 1.0).abs() < 1e-5 && tangent.dot(&normal).abs() < 1e-5);
        let bitangent = normal.cross(&tangent) * w;
        let found = (tangent * lean[0] + bitangent * lean[1] + normal * lean[2]).normalize();
        // +u of the sheet goes along its x.
        let [along, _] = unbent(Vec3::from(position.map(f64::from)));
        let angle = along / BEND;
        let (u, n) = (
            Vec3::new(angle.cos(), 0.0, -angle.sin()),
            Vec3::new(angle.sin(), 0.0, angle.cos()),
        );
        let truth = (u * x + n * z).normalize();
        assert!(found.dot(&truth) > 0.97, "{found:?} for {truth:?}");
        seen += 1;
    }
    assert!(seen > 100);
}

#[test]
fn every_variant_of_the_cloth_has_its_own_image_on_the_patch() {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    let swapped: Vec<[u8; 4]> = sheet
        .texels
        .iter()
        .map(|[r, g, b, a]| [*b, *r, *g, *a])
        .collect();
    let bytes = edited(&fabric(&sheet), |json| {
        push(
            &mut json["images"],
            json!({ "uri": data_uri(&png(sheet.side, &swapped)) }),
        );
        push(&mut json["textures"], json!({ "source": 1 }));
        let mut other = json["materials"][0].clone();
        other["pbrMetallicRoughness"]["baseColorTexture"]["index"] = json!(1);
        push_variant(json, other);
    });
    let own = patched(&bytes, None);
    assert_eq!(
        (own.report.method.as_str(), own.report.layers),
        ("synthesized", 2)
    );
    let (plain, other) = (own.shown(None), own.shown(Some("swapped")));
    let near = |a: u8, b: u8| a.abs_diff(b) < 24;
    let right = (plain.iter().zip(&other))
        .filter(|((_, [r, g, b]), (_, [x, y, z]))| near(*x, *b) && near(*y, *r) && near(*z, *g))
        .count();
    assert!(right * 10 > 9 * plain.len(), "{right} of {}", plain.len());
    let marked = own.material(Some("Reconstruction marked"));
    let shown = &marked["pbrMetallicRoughness"]["baseColorTexture"]["index"];
    let blended = own.material(Some("Reconstruction blended"));
    assert_eq!(
        shown,
        &blended["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    );
}

#[test]
fn materials_that_meet_at_a_hole_go_on_on_their_own_sides() {
    let sheet = TestScan::new(Fabric::Plain, Layout::OneMap, 128);
    let bytes = edited(&fabric(&sheet), |json| {
        // The faces of the sheet's upper half, in rows, get another material: red, without an image.
        let accessor = json["meshes"][0]["primitives"][0]["indices"]
            .as_u64()
            .expect("indices") as usize;
        let count = json["accessors"][accessor]["count"]
            .as_u64()
            .expect("a count");
        let half = count / 6 * 3;
        let size = if json["accessors"][accessor]["componentType"] == 5123 {
            2
        } else {
            4
        };
        let mut upper = json["accessors"][accessor].clone();
        json["accessors"][accessor]["count"] = json!(half);
        upper["count"] = json!(count - half);
        upper["byteOffset"] = json!(half * size);
        let accessors = json["accessors"].as_array_mut().expect("accessors");
        accessors.push(upper);
        let index = accessors.len() - 1;
        let mut primitive = json["meshes"][0]["primitives"][0].clone();
        primitive["indices"] = json!(index);
        primitive["material"] = json!(1);
        push(&mut json["meshes"][0]["primitives"], primitive);
        push(
            &mut json["materials"],
            json!({"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.02, 0.02, 1.0]}}),
        );
    });
    let own = patched(&bytes, None);
    assert_eq!(own.report.method, "synthesized", "{}", own.report.reason);
    assert_eq!(
        own.material(None)["pbrMetallicRoughness"]["baseColorFactor"],
        json!([1.0, 1.0, 1.0, 1.0])
    );
    let is_red = |[r, g, _]: [u8; 3]| r > 150 && g < 90;
    let mut right = 0;
    let shown = own.shown(None);
    for (at, colour) in &shown {
        let [_, y] = unbent(*at);
        right += usize::from(is_red(*colour) == (y > 0.0));
    }
    assert!(right * 10 > 9 * shown.len(), "{right} of {}", shown.len());
}

#[test]
fn a_flat_patch_has_the_mean_colour_and_a_plain_one_none() {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    let bytes = fabric(&sheet);
    let flat = patched(&bytes, Some(TextureChoice::Flat));
    assert_eq!(flat.report.method, "flat");
    let material = &flat.material(None)["pbrMetallicRoughness"];
    assert!(material.get("baseColorTexture").is_none());
    let factor: Vec<f64> =
        serde_json::from_value(material["baseColorFactor"].clone()).expect("four");
    let linear = |x: f32| f64::from(x).powf(2.2);
    let places = (0..64).map(|k| [f64::from(k) - 32.0, 7.0]);
    let colours: Vec<[f32; 3]> = places.map(|p| sheet.truth(p)).collect();
    for k in 0..3 {
        let mean = colours.iter().map(|c| linear(c[k])).sum::<f64>() / colours.len() as f64;
        assert!((factor[k] - mean).abs() < 0.15, "{factor:?}: {k} is {mean}");
    }
    assert!(flat.primitive["attributes"].get("TEXCOORD_1").is_none());
    let plain = patched(&bytes, Some(TextureChoice::None));
    assert_eq!(plain.report.method, "none");
    assert!(
        plain.material(None)["pbrMetallicRoughness"]
            .get("baseColorTexture")
            .is_none()
    );
}

#[test]
fn a_patch_with_images_of_its_own_can_be_taken_out_again() {
    let sheet = TestScan::new(Fabric::Stripes, Layout::Atlas, 64);
    let bytes = fabric(&sheet);
    let once = mended(&bytes, &Constraints::default())
        .expect("one hole")
        .bytes;
    assert_eq!(read(&once).parts.len(), 2);
    let limits = darn_gltf_scan::ScanLimits::default();
    let stripped = darn_gltf_scan::stripped(once, &limits, darn_budget::Budget::unlimited());
    let stripped = stripped.expect("a scan").expect("a mended one");
    assert!(stripped.exact && stripped.bytes == bytes);
}

#[test]
fn the_same_request_gives_the_same_bytes() {
    let sheet = TestScan::new(Fabric::Print, Layout::Atlas, 64);
    let bytes = fabric(&sheet);
    let [one, two] = [1, 2].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        pool.install(|| {
            mended(&bytes, &Constraints::default())
                .expect("one hole")
                .bytes
        })
    });
    assert!(one == two);
}
