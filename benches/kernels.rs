//! Times the stages of a mend on the example scan: `cargo bench --bench kernels [-- FILTER]`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use darn_budget::Budget;
use darn_geometry::flatten::{self, Chart};
use darn_geometry::grid::{CELLS, Grid};
use darn_geometry::mesh::loops::{LoopKind, boundary_loops};
use darn_geometry::mesh::region::{BoundedMesh, Region, grow};
use darn_geometry::mesh::weld::weld;
use darn_geometry::mesh::{TriMesh, Vec2, Vec3};
use darn_geometry::patch::{self, Firmness, PatchOptions, Pull};
use darn_gltf_scan::Scan;
use darn_net::engine::{Engine, EngineInput, EngineOptions, InputGradient, Isa, Scratch};
use darn_net::weights;

/// The hole of the example scan with the region around it, its chart and its grid.
struct Hole {
    surface: TriMesh,
    region: Region,
    chart: Chart,
    grid: Grid,
}

/// Reach of the region, scene units; the example's hole is a third of a unit wide.
const REACH: f64 = 0.25;

fn hole() -> Hole {
    let bytes = std::fs::read("examples/scarf_hole.glb").expect("run in the repository's root");
    let scan = Scan::read(bytes, &Default::default()).expect("the example is a scan");
    let welded = weld(&scan.surface);
    let topology = welded.topology();
    let loops = boundary_loops(&welded.mesh, &topology);
    let rim = loops.iter().find(|l| l.kind == LoopKind::Hole);
    let rim = rim.expect("the example has a hole").id;
    let region = grow(
        &BoundedMesh {
            mesh: &welded.mesh,
            topology: &topology,
            loops: &loops,
        },
        rim,
        REACH,
        Budget::unlimited(),
    )
    .expect("it is a disk");
    let chart =
        flatten::flatten(&region, &Default::default(), Budget::unlimited()).expect("it lies flat");
    let grid = flatten::raster(&region.mesh, &chart);
    Hole {
        surface: scan.surface,
        region,
        chart,
        grid,
    }
}

fn mesh(c: &mut Criterion) {
    let hole = hole();
    c.bench_function("weld", |b| b.iter(|| weld(black_box(&hole.surface))));
    c.bench_function("flatten", |b| {
        b.iter(|| {
            flatten::flatten(
                black_box(&hole.region),
                &Default::default(),
                Budget::unlimited(),
            )
        })
    });
    c.bench_function("raster", |b| {
        b.iter(|| flatten::raster(black_box(&hole.region.mesh), &hole.chart))
    });
}

fn patches(c: &mut Criterion) {
    let hole = hole();
    let options = PatchOptions::default();
    let normal = hole.grid.normalisation().expect("cells are known");
    let positions = hole.grid.normalised(&normal).positions;
    let known = &hole.grid.known;
    c.bench_function("plate", |b| {
        b.iter(|| darn_net::plate(black_box(&positions), known))
    });
    let plate = darn_net::plate(&positions, known).expect("a plate");
    let filled: Vec<Vec3> = (hole.grid.positions.iter().zip(known).zip(&plate))
        .map(|((own, known), q)| if *known { *own } else { normal.to_scene(q) })
        .collect();
    let plan = || patch::plan(&hole.region, &hole.chart, &options);
    c.bench_function("patch, plan", |b| b.iter(plan));
    let plan = plan().expect("a plan");
    let patch = |pulls: &[Pull]| {
        plan.patch(&hole.chart, &filled, pulls, &options)
            .expect("a patch")
    };
    c.bench_function("patch, unedited", |b| b.iter(|| patch(&[])));
    let unpulled = patch(&[]);
    let middle = unpulled.flat.iter().sum::<Vec2>() / unpulled.flat.len() as f64;
    let pull = Pull {
        at: middle,
        to: unpulled.at(middle) + Vec3::new(0.0, 0.02, 0.0),
        firmness: Firmness::Soft,
    };
    c.bench_function("patch, one pull", |b| b.iter(|| patch(&[pull])));
}

fn network(c: &mut Criterion) {
    let bytes =
        std::fs::read("weights/standard.safetensors").expect("run in the repository's root");
    let (card, tensors) = weights::read(&bytes).expect("the weights are darn's");
    for isa in Isa::ALL.into_iter().filter(|isa| isa.is_available()) {
        let options = EngineOptions {
            isa: Some(isa),
            threads: 1,
        };
        let engine = Engine::new(&tensors, &card.architecture, options).expect("an engine");
        for count in [1, 4] {
            let x: Vec<f32> = (0..count * 3 * CELLS)
                .map(|k| (k % 97) as f32 / 97.0)
                .collect();
            let known: Vec<f32> = (0..count * CELLS)
                .map(|k| f32::from(u8::from(k % 64 < 40)))
                .collect();
            let input = EngineInput {
                positions: &x,
                known: &known,
                base: None,
                up: None,
            };
            let (mut scratch, mut out) = (Scratch::default(), x.clone());
            let name = format!("network {}, {count} grid(s)", isa.name());
            c.bench_function(&name, |b| {
                b.iter(|| engine.predict(&mut scratch, black_box(input), &mut out))
            });
            let (mut by_positions, mut by_known) = (x.clone(), known.clone());
            c.bench_function(&format!("{name}, gradient"), |b| {
                b.iter(|| {
                    let out = InputGradient {
                        prediction: &mut out,
                        by_positions: &mut by_positions,
                        by_known: &mut by_known,
                    };
                    let cotangent = |_: usize, y: &[f32], by: &mut [f32]| by.copy_from_slice(y);
                    engine.gradient(&mut scratch, black_box(input), &cotangent, out)
                })
            });
        }
    }
}

criterion_group!(benches, mesh, patches, network);
criterion_main!(benches);
