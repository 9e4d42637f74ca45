//! Lab only.
use darn::{contract::Constraints, mend::*, net::*, scan::*};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let ev = |k: &str, d: f64| std::env::var(k).ok().map_or(d, |s| s.parse().unwrap());
    let w = std::fs::read(
        std::env::var("WEIGHTS").unwrap_or("/work/main/weights/standard.safetensors".into()),
    )
    .unwrap();
    let mut limits = Limits::default();
    let e = &mut limits.patch.elastics;
    e.strain = ev("STRAIN", e.strain);
    e.bending = ev("BEND", e.bending);
    e.rest_curvature = ev("RC", e.rest_curvature);
    e.tether = ev("TETHER", e.tether);
    e.rounds = ev("ROUNDS", e.rounds as f64) as usize;
    let m = Mender {
        network: Network::load(&w, BackendKind::Flex).unwrap(),
        limits,
    };
    for p in a[1..].chunks(2) {
        let s = Scan::read(
            &std::fs::read(&p[0]).unwrap(),
            &darn::scan::Limits::default(),
        )
        .unwrap();
        match mend(&s, &Constraints::default(), &m) {
            Ok(r) => std::fs::write(&p[1], r.bytes).unwrap(),
            Err(e) => {
                eprintln!("{}: {e}", p[0]);
                let _ = std::fs::remove_file(&p[1]);
            }
        }
    }
}
