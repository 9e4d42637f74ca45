//! A mend in words, for a terminal.

use super::holes::{kind_name, set_aside};
use darn_contract::v1::{HoleReport, Report};
/// One line for each loop, with its patch or the reason why it was left, and one for each note.
pub fn summary(report: &Report) -> String {
    let mut text = String::new();
    for hole in &report.holes {
        let patch = hole.patch.clone().unwrap_or_default();
        let crossings = match patch.self_intersections {
            0 => String::new(),
            n => format!(", {n} self-intersections"),
        };
        text.push_str(&format!(
            "hole {}: rim of {} vertices, length {:.4}; patched with {} faces, stretch {:.3}{crossings}{}\n",
            hole.id,
            hole.vertices,
            hole.length,
            patch.faces,
            patch.stretch_mean,
            texture(hole)
        ));
        text.push_str(&distances(hole));
    }
    for left in &report.skipped {
        text.push_str(&format!(
            "left loop {} ({}): {}\n",
            left.id,
            kind_name(left.kind()),
            left.reason
        ));
    }
    text.push_str(&set_aside(&report.set_aside));
    for note in report
        .notes
        .iter()
        .chain(report.holes.iter().flat_map(|hole| &hole.notes))
    {
        text.push_str(&format!("note: {note}\n"));
    }
    text
}

/// What a patch's line says about images of its own.
fn texture(hole: &HoleReport) -> String {
    match &hole.texture {
        Some(own) if own.layers > 0 => {
            format!(", a texture of {} x {} texels", own.width, own.height)
        }
        _ => String::new(),
    }
}

/// One line for each anchor or gesture: its distance to the cloth.
fn distances(hole: &HoleReport) -> String {
    let anchors = hole.anchors.iter().map(|a| {
        let at: Vec<String> = a.uv.iter().map(|x| format!("{x:.3}")).collect();
        format!("  anchor at {}: {:.4} away\n", at.join(" "), a.distance)
    });
    let edits = hole.edits.iter().map(|e| {
        format!(
            "  gesture of {} point(s): at most {:.4} away\n",
            e.anchors, e.distance
        )
    });
    anchors.chain(edits).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darn_contract::v1::Skipped;

    #[test]
    fn every_loop_has_a_line() {
        let report = Report {
            holes: vec![HoleReport {
                id: 1,
                ..HoleReport::default()
            }],
            skipped: vec![Skipped {
                id: 0,
                reason: "it is the cloth's own edge".into(),
                ..Skipped::default()
            }],
            ..Report::default()
        };
        let text = summary(&report);
        assert!(
            text.starts_with("hole 1: ") && text.contains("left loop 0"),
            "{text}"
        );
    }
}
