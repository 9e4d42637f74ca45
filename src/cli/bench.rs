//! `darn bench`: how long the network and a mend take on this machine. The engines take turns, so that a busy moment
//! slows all of them.

use super::failure::{Failure, OrFail};
use super::files;
use super::network::mender;
use crate::settings::NetworkArgs;
use darn_contract::Constraints;
use darn_geometry::grid::{CELLS, NormalGrid, SIDE};
use darn_gltf_scan::{Scan, ScanLimits};
#[cfg(feature = "burn")]
use darn_lab::unet::{BackendKind, load_network};
use darn_net::engine::{Engine, EngineInput, EngineOptions, InputGradient, Isa, Scratch};
use darn_net::{Averaging, FillRequest, NetError, Network, UnetConfig, weights};
use serde_json::json;
use std::path::PathBuf;
use std::time::{Duration, Instant};

#[derive(Debug, clap::Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    command: BenchCommand,
}

#[derive(Debug, clap::Subcommand)]
enum BenchCommand {
    /// Forward passes and input gradients: the engine on every instruction set of this CPU, and burn's backends
    Net(BenchNetArgs),
    /// A whole mend, stage by stage
    Mend(BenchMendArgs),
}

#[derive(Debug, clap::Args)]
struct BenchNetArgs {
    /// Weights file; left out, the shipped standard ones
    #[arg(long)]
    weights: Option<PathBuf>,
    /// Grids in a pass
    #[arg(long, value_delimiter = ',', default_value = "1,8")]
    batch: Vec<usize>,
    /// Threads that share a pass
    #[arg(long, value_delimiter = ',', default_value = "1,2")]
    threads: Vec<usize>,
    /// Turns of every engine
    #[arg(long, default_value_t = 5)]
    rounds: usize,
    /// Milliseconds of a turn
    #[arg(long, default_value_t = 300)]
    turn: u64,
    /// The engine alone, on its best instruction set
    #[arg(long)]
    own: bool,
    /// A line of JSON for each row
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
struct BenchMendArgs {
    /// The scan
    scan: PathBuf,
    /// How often it is mended
    #[arg(long, default_value_t = 30)]
    times: usize,
    #[command(flatten)]
    network: NetworkArgs,
}

/// Runs `darn bench`.
pub fn run(args: &BenchArgs) -> Result<(), Failure> {
    match &args.command {
        BenchCommand::Net(args) => net(args),
        BenchCommand::Mend(args) => mend(args),
    }
}

/// A pass of an engine, and how long its calls took.
struct BenchRow<'a> {
    engine: String,
    what: &'static str,
    size: BenchSize,
    call: TimedCall<'a>,
    milliseconds: Vec<f64>,
}

/// How many grids a pass has, and how many threads share it.
#[derive(Debug, Clone, Copy)]
struct BenchSize {
    batch: usize,
    threads: usize,
}

/// The calls of an engine that are timed.
struct Passes<'a> {
    forward: TimedCall<'a>,
    gradient: TimedCall<'a>,
}

impl BenchRow<'_> {
    /// Calls until `turn` has passed, and at least twice.
    fn take_turn(&mut self, turn: Duration) -> Result<(), NetError> {
        let started = Instant::now();
        let mut calls = 0;
        while calls < 2 || started.elapsed() < turn {
            let call = Instant::now();
            (self.call)()?;
            self.milliseconds.push(call.elapsed().as_secs_f64() * 1e3);
            calls += 1;
        }
        Ok(())
    }
}

fn net(args: &BenchNetArgs) -> Result<(), Failure> {
    let bytes = match &args.weights {
        Some(path) => files::read(path)?,
        None => super::network::standard().to_vec(),
    };
    let (card, tensors) = weights::read(&bytes).or_fail("read the weights")?;
    let config = card.architecture;
    let mut engines = Vec::new();
    for threads in &args.threads {
        let best = Isa::ALL.into_iter().filter(|isa| isa.is_available());
        let isas: Vec<Isa> = match args.own {
            true => best.rev().take(1).collect(),
            false => best.rev().collect(),
        };
        for isa in isas {
            let isa = Some(isa);
            let threads = *threads;
            let engine = Engine::new(&tensors, &config, EngineOptions { isa, threads });
            engines.push((threads, engine.or_fail("build the engine")?));
        }
    }
    let mut pools = Vec::new();
    for threads in &args.threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(*threads);
        pools.push((*threads, pool.build().or_fail("start threads")?));
    }
    let networks = if args.own {
        Vec::new()
    } else {
        burn_networks(&bytes)?
    };
    let mut rows = Vec::new();
    for batch in &args.batch {
        for (threads, engine) in &engines {
            let pool = pools.iter().find(|(t, _)| t == threads);
            let Some((_, pool)) = pool else { continue };
            let size = BenchSize {
                batch: *batch,
                threads: *threads,
            };
            let name = format!("engine {}", engine.isa().name());
            rows.extend(bench_rows(&name, size, engine_passes(engine, pool, *batch)));
        }
        for (name, network) in &networks {
            for (threads, pool) in &pools {
                let size = BenchSize {
                    batch: *batch,
                    threads: *threads,
                };
                let passes = network_passes(network, pool, *batch);
                let rows_of_burn = bench_rows(&format!("burn {name}"), size, passes);
                // burn-ndarray's gradient takes seconds for each grid, so it is left out.
                let fast_enough = |row: &BenchRow| *name != "ndarray" || row.what == "forward";
                rows.extend(rows_of_burn.into_iter().filter(fast_enough));
            }
        }
    }
    for _ in 0..args.rounds {
        for row in &mut rows {
            let took = row.take_turn(Duration::from_millis(args.turn));
            took.or_fail(format!("run {}", row.engine))?;
        }
    }
    if args.json {
        print_json(&mut rows);
    } else {
        print_table(&mut rows, &config);
    }
    Ok(())
}

/// The network on burn's backends, by name.
#[cfg(feature = "burn")]
fn burn_networks(bytes: &[u8]) -> Result<Vec<(&'static str, Network)>, Failure> {
    let load = |(name, kind)| {
        let network = load_network(bytes, kind).or_fail("load the weights")?;
        Ok((name, network))
    };
    [
        ("flex", BackendKind::Flex),
        ("ndarray", BackendKind::Ndarray),
    ]
    .map(load)
    .into_iter()
    .collect()
}

/// A build without burn has no backends of burn.
#[cfg(not(feature = "burn"))]
fn burn_networks(_: &[u8]) -> Result<Vec<(&'static str, Network)>, Failure> {
    Ok(Vec::new())
}

/// Waves with a square hole in the middle.
fn grid(number: usize) -> NormalGrid {
    let at = |k: usize| [k % SIDE, k / SIDE].map(|x| (x as f32 + 0.5) / SIDE as f32 - 0.5);
    let positions = (0..CELLS).map(|k| {
        let [u, v] = at(k);
        [u, v, 0.1 * (9.0 * u + 4.0 * v + number as f32).sin()]
    });
    let known = (0..CELLS).map(|k| f32::from(u8::from(at(k).iter().any(|x| x.abs() > 0.2))));
    NormalGrid {
        positions: positions.collect(),
        known: known.collect(),
        base: Some(vec![[0.0; 3]; CELLS]),
    }
}

/// The passes of the engine on `batch` grids.
fn engine_passes<'a>(engine: &'a Engine, pool: &'a rayon::ThreadPool, batch: usize) -> Passes<'a> {
    let planes: Vec<f32> = (0..batch)
        .flat_map(|n| {
            let cells = grid(n).positions;
            (0..3).flat_map(move |axis| cells.iter().map(|p| p[axis]).collect::<Vec<_>>())
        })
        .collect();
    let known: Vec<f32> = (0..batch).flat_map(|n| grid(n).known).collect();
    let (x, k) = (planes.clone(), known.clone());
    let (mut scratch, mut out) = (Scratch::default(), vec![0.0; planes.len()]);
    let forward = move || {
        let input = EngineInput {
            positions: &x,
            known: &k,
            base: None,
            up: None,
        };
        Ok(pool.install(|| engine.predict(&mut scratch, input, &mut out))?)
    };
    let mut scratch = Scratch::default();
    let mut outs = [planes.len(), planes.len(), known.len()].map(|size| vec![0.0; size]);
    let gradient = move || {
        let input = EngineInput {
            positions: &planes,
            known: &known,
            base: None,
            up: None,
        };
        let [prediction, by_positions, by_known] = &mut outs;
        let out = InputGradient {
            prediction,
            by_positions,
            by_known,
        };
        let cotangent =
            |_: usize, prediction: &[f32], by: &mut [f32]| by.copy_from_slice(prediction);
        Ok(pool.install(|| engine.gradient(&mut scratch, input, &cotangent, out))?)
    };
    Passes {
        forward: Box::new(forward),
        gradient: Box::new(gradient),
    }
}

/// The passes of a network on `batch` grids.
fn network_passes<'a>(
    network: &'a Network,
    pool: &'a rayon::ThreadPool,
    batch: usize,
) -> Passes<'a> {
    let grids: Vec<NormalGrid> = (0..batch).map(grid).collect();
    let forward = move || {
        let request = FillRequest {
            grids: &grids,
            up: None,
            averaging: Averaging::Once,
        };
        pool.install(|| network.fill(&request)).map(drop)
    };
    let (one, uvs) = (grid(0), vec![[0.5; 2]; batch]);
    let gradient = move || {
        let problem = network.anchor_problem(&one, [0.0; 3], None)?;
        let found = pool.install(|| network.anchor_gradients(&problem, &uvs));
        found.map(drop)
    };
    Passes {
        forward: Box::new(forward),
        gradient: Box::new(gradient),
    }
}

type TimedCall<'a> = Box<dyn FnMut() -> Result<(), NetError> + 'a>;

/// The rows of an engine's two passes.
fn bench_rows<'a>(engine: &str, size: BenchSize, passes: Passes<'a>) -> [BenchRow<'a>; 2] {
    [("forward", passes.forward), ("gradient", passes.gradient)].map(|(what, call)| BenchRow {
        engine: engine.to_owned(),
        what,
        size,
        call,
        milliseconds: Vec::new(),
    })
}

/// GFLOP of a forward pass for one grid, a multiply-add counted as two; the paper's network of width 64 has 9.15.
fn gigaflops(config: &UnetConfig) -> f64 {
    9.15 * (config.width as f64 / 64.0).powi(2)
}

fn print_json(rows: &mut [BenchRow]) {
    for row in rows {
        let (least, median) = spread(&mut row.milliseconds);
        let (engine, isa) = row.engine.split_once(' ').unwrap_or((&row.engine, ""));
        let BenchSize { batch, threads } = row.size;
        let line = json!({
            "engine": engine, "isa": isa, "precision": "f32", "what": row.what, "batch": batch,
            "threads": threads, "least_ms": least, "median_ms": median,
        });
        println!("{line}");
    }
}

fn print_table(rows: &mut [BenchRow], config: &UnetConfig) {
    println!(
        "| engine | what | batch | threads | least ms | median ms | GFLOP/s |\n|---|---|---|---|---|---|---|"
    );
    for row in rows {
        let (least, median) = spread(&mut row.milliseconds);
        let BenchSize { batch, threads } = row.size;
        let rate = match row.what {
            "forward" => format!("{:.0}", gigaflops(config) * batch as f64 / median * 1e3),
            _ => String::new(),
        };
        println!(
            "| {} | {} | {batch} | {threads} | {least:.2} | {median:.2} | {rate} |",
            row.engine, row.what
        );
    }
}

/// The least and the median.
fn spread(numbers: &mut [f64]) -> (f64, f64) {
    numbers.sort_by(f64::total_cmp);
    let at = |k: usize| numbers.get(k).copied().unwrap_or(0.0);
    (at(0), at(numbers.len() / 2))
}

fn mend(args: &BenchMendArgs) -> Result<(), Failure> {
    let name = args.scan.display();
    let bytes = files::read(&args.scan)?;
    let mender = mender(&args.network)?;
    let mut stages: Vec<(&str, Vec<f64>)> = Vec::new();
    for _ in 0..=args.times {
        let bytes = bytes.clone();
        let started = Instant::now();
        let scan = Scan::read(bytes, &ScanLimits::default()).or_fail(format!("read {name}"))?;
        let read = started.elapsed();
        let mended = darn_mend::mend(&scan, &Constraints::default(), &mender);
        let mut mended = mended.or_fail(format!("mend {name}"))?;
        darn_mend::add_read_time(&mut mended.report.timings, read);
        let scan = mended.report.timings.unwrap_or_default();
        let sum = |of: fn(&darn_contract::v1::HoleTimings) -> f64| -> f64 {
            let each = mended.report.holes.iter().flat_map(|hole| &hole.timings);
            each.map(of).sum()
        };
        let all = [
            ("read", scan.read),
            ("weld", scan.weld),
            ("loops", scan.loops),
            ("region", sum(|t| t.region)),
            ("flatten", sum(|t| t.flatten)),
            ("raster", sum(|t| t.raster)),
            ("net", sum(|t| t.net)),
            ("patch", sum(|t| t.patch)),
            ("report", sum(|t| t.report)),
            ("write", scan.write),
            ("total", scan.total),
        ];
        if stages.is_empty() {
            // The first mend warms up.
            stages = all.map(|(name, _)| (name, Vec::new())).into();
            continue;
        }
        for ((_, numbers), (_, number)) in stages.iter_mut().zip(all) {
            numbers.push(number);
        }
    }
    println!("| stage | least ms | median ms |\n|---|---|---|");
    for (stage, numbers) in &mut stages {
        let (least, median) = spread(numbers);
        println!("| {stage} | {least:.2} | {median:.2} |");
    }
    Ok(())
}
