//! Measures interactive editing on held-out sheets: how near the cloth comes to anchors, how much anchors on the cloth change it, what
//! anchors far away do, and how the anchor search compares with trying every cell. `cargo run --release --example editing_table -- SHEETS [--weights FILE] [--count N]`
//!
//! SHEETS is a folder that `darn scarffolds` wrote with seeds that the network was not trained on.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use clap::Parser;
use darn_budget::Budget;
use darn_contract::{Anchor, Constraints, Edit, Gesture, Search};
use darn_geometry::mesh::curvature::vertex_normals;
use darn_geometry::mesh::{Vec2, Vec3};
use darn_gltf_scan::Scan;
use darn_gltf_scan::export::{NewMesh, glb};
use darn_lab::scarffolds::holed_scan::{HoleShape, holed_scan};
use darn_lab::scarffolds::sheets;
use darn_lab::scarffolds::sheets::SimulatedSheet;
use darn_mend::{EditedFill, MendLimits, NetworkMender, ScanSession};
use darn_net::engine::EngineOptions;
use darn_net::{Network, Networks};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

#[derive(Parser)]
struct Args {
    /// Folder of held-out sheets
    sheets: PathBuf,
    /// Weights file
    #[arg(long, default_value = "weights/standard.safetensors")]
    weights: PathBuf,
    /// How many (sheet, hole, target) triples
    #[arg(long, default_value_t = 100)]
    count: usize,
    /// How the network is asked for edited cloth: `difference` or `plain`
    #[arg(long, default_value = "difference")]
    response: String,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args = Args::parse();
    let standard = Network::load(&std::fs::read(&args.weights)?, EngineOptions::default())?;
    let mender = Arc::new(NetworkMender {
        limits: MendLimits {
            edited_fill: match args.response.as_str() {
                "plain" => EditedFill::Plain,
                _ => EditedFill::Difference,
            },
            ..MendLimits::default()
        },
        ..NetworkMender::new(Networks::new(standard, Vec::new()))
    });
    let sheets = sheets::read(&args.sheets)?;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut rows = Vec::new();
    let mut refused = 0;
    for k in 0..args.count {
        let sheet = &sheets[k % sheets.len()];
        let hole = hole(k, &mut rng);
        match Case::open(sheet, &hole, &mender, &mut rng) {
            Some(case) => rows.push(case.measure(&mut rng)?),
            None => refused += 1,
        }
        eprint!("\r{}/{}", k + 1, args.count);
    }
    eprintln!();
    println!("{} cases, {refused} refused (not cloth-like)\n", rows.len());
    print(&rows);
    Ok(())
}

fn hole(k: usize, rng: &mut ChaCha8Rng) -> HoleShape {
    let centre = Vec2::new(rng.random_range(0.42..0.58), rng.random_range(0.42..0.58));
    let radius = rng.random_range(0.09..0.17);
    match k % 3 {
        0 => HoleShape::Circle { centre, radius },
        1 => HoleShape::Blob { centre, radius },
        _ => HoleShape::Slit {
            centre,
            length: 1.5 * radius,
            width: 0.45 * radius,
            angle: rng.random_range(0.0..3.0),
        },
    }
}

/// A session on a sheet with a hole.
struct Case {
    session: ScanSession,
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    rim: usize,
    cell: f64,
    extent: f64,
    open_ms: f64,
}

/// The measurements of a case.
struct Row {
    /// Cells the cloth moves (RMS) for anchors where it is.
    still: f64,
    /// For an anchor two cells away in a random direction: cells between it and the cloth, cells of these beyond reach, stretch.
    off: [f64; 3],
    /// The same for an anchor two cells away across the cloth.
    across: [f64; 3],
    /// Stretch without and with an anchor ten hole widths away, and the largest move in hole widths.
    absurd: [f64; 3],
    /// Losses of the search and of trying all, cells between the two results; evaluations, gradients and milliseconds of each.
    search: [f64; 9],
    /// Milliseconds of opening, and of moving one anchor.
    ms: [f64; 2],
}

impl Case {
    fn open(
        sheet: &SimulatedSheet,
        hole: &HoleShape,
        mender: &Arc<NetworkMender>,
        rng: &mut ChaCha8Rng,
    ) -> Option<Case> {
        let mesh = holed_scan(sheet, 45, hole, rng).mesh;
        let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.cast().into()).collect();
        let normals: Vec<[f32; 3]> = vertex_normals(&mesh)
            .iter()
            .map(|n| n.cast().into())
            .collect();
        let fresh = NewMesh {
            name: "sheet",
            positions: &positions,
            normals: &normals,
            texcoords: &[],
            faces: &mesh.faces,
        };
        let scan = Scan::read(glb(&fresh).ok()?, &darn_gltf_scan::ScanLimits::default()).ok()?;
        let started = Instant::now();
        let session = ScanSession::open(
            scan,
            &Constraints::default(),
            Arc::clone(mender),
            Budget::unlimited(),
        )
        .ok()?;
        let open_ms = started.elapsed().as_secs_f64() * 1e3;
        let described = session.described();
        let hole = described.holes.iter().max_by_key(|h| h.hole_cells.len())?;
        let place = described.holes.iter().position(|h| h.id == hole.id)?;
        let uvs: Vec<Vec2> = (hole.patch_uvs.chunks_exact(2))
            .map(|uv| Vec2::new(uv[0], uv[1]))
            .collect();
        let rim = hole.rim_uvs.len() / 2;
        let low = uvs[..rim].iter().fold(Vec2::repeat(1.0), |m, uv| m.inf(uv));
        let high = uvs[..rim].iter().fold(Vec2::zeros(), |m, uv| m.sup(uv));
        let (positions, report) = session
            .call(Budget::unlimited())
            .positions(&Constraints::default())
            .ok()?;
        let cell = report.holes.get(place)?.grid?.spacing_mean;
        (described.holes.len() == 1 && uvs.len() > rim).then(|| Case {
            positions: positions[0].clone(),
            uvs,
            rim,
            cell,
            extent: (high - low).max() * 64.0 * cell,
            open_ms,
            session,
        })
    }

    /// An inner vertex at least three cells from the rim, or the one farthest from it.
    fn vertex(&self, rng: &mut ChaCha8Rng) -> usize {
        let depth = |v: usize| {
            let each = self.uvs[..self.rim].iter();
            each.map(|r| (r - self.uvs[v]).norm())
                .fold(f64::MAX, f64::min)
                * 64.0
        };
        let deep: Vec<usize> = (self.rim..self.uvs.len())
            .filter(|v| depth(*v) >= 3.0)
            .collect();
        match deep.as_slice() {
            [] => (self.rim..self.uvs.len())
                .max_by(|a, b| depth(*a).total_cmp(&depth(*b)))
                .unwrap_or(self.rim),
            deep => deep[rng.random_range(0..deep.len())],
        }
    }

    fn anchor(&self, vertex: usize, by: Vec3) -> Anchor {
        Anchor {
            hole: None,
            uv: Some(self.uvs[vertex].into()),
            position: (self.positions[vertex] + by).into(),
            hard: false,
        }
    }

    /// Distance to the anchor and how much of it is beyond reach, in cells; the largest stretch.
    fn kept(&self, vertex: usize, by: Vec3) -> Result<([f64; 3], Vec<Vec3>), darn_mend::MendError> {
        let asked = anchored(vec![self.anchor(vertex, by)]);
        let (mut positions, report) = self.session.call(Budget::unlimited()).positions(&asked)?;
        let hole = &report.holes[0];
        let (anchor, patch) = (&hole.anchors[0], hole.patch.clone().unwrap_or_default());
        let numbers = [
            anchor.distance / self.cell,
            anchor.beyond_reach / self.cell,
            patch.stretch_max,
        ];
        Ok((numbers, positions.remove(0)))
    }

    fn measure(&self, rng: &mut ChaCha8Rng) -> Result<Row, darn_mend::MendError> {
        let still: Vec<Anchor> = (0..3)
            .map(|_| self.anchor(self.vertex(rng), Vec3::zeros()))
            .collect();
        let (positions, plain) = self
            .session
            .call(Budget::unlimited())
            .positions(&anchored(still))?;
        let squares = positions[0].iter().zip(&self.positions).skip(self.rim);
        let squares: f64 = squares.map(|(a, b)| (a - b).norm_squared()).sum();
        let still = (squares / (self.uvs.len() - self.rim) as f64).sqrt() / self.cell;
        let stretch = plain.holes[0].patch.clone().unwrap_or_default().stretch_max;

        let vertex = self.vertex(rng);
        let normal = self.normal(vertex);
        let off = self.kept(vertex, direction(rng) * 2.0 * self.cell)?.0;
        let across = self.kept(vertex, normal * 2.0 * self.cell)?.0;
        let (far, moved) = self.kept(vertex, direction(rng) * 10.0 * self.extent)?;
        let most = moved
            .iter()
            .zip(&self.positions)
            .map(|(a, b)| (a - b).norm());
        let absurd = [stretch, far[2], most.fold(0.0, f64::max) / self.extent];

        let started = Instant::now();
        let grab = Edit {
            hole: None,
            gesture: Gesture::Grab {
                uv: self.uvs[vertex].into(),
                offset: (normal * self.cell).into(),
            },
        };
        self.session
            .call(Budget::unlimited())
            .positions(&Constraints {
                edits: vec![grab],
                ..Constraints::default()
            })?;
        let edit_ms = started.elapsed().as_secs_f64() * 1e3;
        Ok(Row {
            still,
            off,
            across,
            absurd,
            search: self.search(rng)?,
            ms: [self.open_ms, edit_ms],
        })
    }

    fn search(&self, rng: &mut ChaCha8Rng) -> Result<[f64; 9], darn_mend::MendError> {
        let by = direction(rng) * rng.random_range(0.0..3.0) * self.cell;
        let search = Search {
            hole: None,
            target: (self.positions[self.vertex(rng)] + by).into(),
            start: None,
            exhaustive: false,
            map: false,
            map_gradient: false,
        };
        let found = self
            .session
            .call(Budget::unlimited())
            .optimize_anchor(&search)?;
        let best = self
            .session
            .call(Budget::unlimited())
            .optimize_anchor(&Search {
                exhaustive: true,
                ..search
            })?;
        let apart = |d: usize| f64::from(found.cell[d]) - f64::from(best.cell[d]);
        Ok([
            found.loss,
            best.loss,
            apart(0).hypot(apart(1)),
            found.evaluations.into(),
            found.gradients.into(),
            found.milliseconds,
            best.evaluations.into(),
            best.gradients.into(),
            best.milliseconds,
        ])
    }

    /// The rim's mean normal, on the side away from which the cloth bulges at a vertex.
    fn normal(&self, vertex: usize) -> Vec3 {
        let rim = &self.positions[..self.rim];
        let middle = rim.iter().sum::<Vec3>() / rim.len() as f64;
        let turned: Vec3 = (0..self.rim)
            .map(|k| (rim[k] - middle).cross(&(rim[(k + 1) % self.rim] - middle)))
            .sum();
        let normal = turned.try_normalize(0.0).unwrap_or_else(Vec3::z);
        let side = (self.positions[vertex] - middle).dot(&normal);
        normal * if side < 0.0 { 1.0 } else { -1.0 }
    }
}

fn direction(rng: &mut ChaCha8Rng) -> Vec3 {
    let mut along = || rng.random_range(-1.0..1.0f64);
    let d = Vec3::new(along(), along(), along());
    d.try_normalize(1e-6).unwrap_or_else(Vec3::x)
}

fn anchored(anchors: Vec<Anchor>) -> Constraints {
    Constraints {
        anchors,
        ..Constraints::default()
    }
}

fn print(rows: &[Row]) {
    let share = |fine: &dyn Fn(&Row) -> bool| {
        100.0 * rows.iter().filter(|r| fine(r)).count() as f64 / rows.len().max(1) as f64
    };
    println!("| anchors | share / median | 90th percentile |\n|---|---|---|");
    let line = |name: &str, of: &dyn Fn(&Row) -> f64| {
        let each = sorted(rows, of);
        println!("| {name} | {:.3} | {:.3} |", at(&each, 0.5), at(&each, 0.9));
    };
    line("on the unedited cloth: change, cells RMS", &|r| r.still);
    println!(
        "| … below 0.1 cell | {:.0} % | |",
        share(&|r| r.still < 0.1)
    );
    for (name, of) in [
        (
            "2 cells off, any direction",
            (|r: &Row| r.off) as fn(&Row) -> [f64; 3],
        ),
        ("2 cells off, across the cloth", |r: &Row| r.across),
    ] {
        line(&format!("{name}: distance kept, cells"), &|r| of(r)[0]);
        line("… of it beyond reach", &|r| of(r)[1]);
        line("… largest stretch of an edge", &|r| of(r)[2]);
        println!(
            "| … within 0.5 cell | {:.0} % | |",
            share(&|r| of(r)[0] <= 0.5)
        );
        println!(
            "| … within 0.5 cell of what is in reach | {:.0} % | |",
            share(&|r| of(r)[0] - of(r)[1] <= 0.5)
        );
    }
    line("no anchor: largest stretch of an edge", &|r| r.absurd[0]);
    line("10 hole widths off: largest stretch", &|r| r.absurd[1]);
    line("… largest move, hole widths", &|r| r.absurd[2]);
    println!();
    println!("| search | value |\n|---|---|");
    println!(
        "| within 2 cells of the exhaustive optimum, or within 10 % of its loss | {:.0} % |",
        share(&|r| r.search[2] <= 2.0 || r.search[0] <= 1.1 * r.search[1])
    );
    println!(
        "| the same cell | {:.0} % |",
        share(&|r| r.search[2] == 0.0)
    );
    println!(
        "| within 2 cells | {:.0} % |",
        share(&|r| r.search[2] <= 2.0)
    );
    println!(
        "| within 10 % of its loss | {:.0} % |\n",
        share(&|r| r.search[0] <= 1.1 * r.search[1])
    );
    println!(
        "| | evaluations | of them with gradient | ms, median | ms, 95th percentile |\n|---|---|---|---|---|"
    );
    for (name, first) in [("search", 3), ("every cell", 6)] {
        let column = |k: usize| sorted(rows, &|r| r.search[first + k]);
        println!(
            "| {name} | {:.0} | {:.0} | {:.0} | {:.0} |",
            at(&column(0), 0.5),
            at(&column(1), 0.5),
            at(&column(2), 0.5),
            at(&column(2), 0.95)
        );
    }
    println!();
    println!("| session | ms, median | ms, 95th percentile |\n|---|---|---|");
    for (name, k) in [("open", 0), ("one grab, patches alone", 1)] {
        let column = sorted(rows, &|r| r.ms[k]);
        println!(
            "| {name} | {:.1} | {:.1} |",
            at(&column, 0.5),
            at(&column, 0.95)
        );
    }
}

fn sorted(rows: &[Row], of: &dyn Fn(&Row) -> f64) -> Vec<f64> {
    let mut each: Vec<f64> = rows.iter().map(of).collect();
    each.sort_by(f64::total_cmp);
    each
}

fn at(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(f64::NAN)
}
