//! What `docs/pipelines.md` says of Smithsonian Cook: its command line runs, and its recipe is one.

use std::{collections::BTreeSet, path::Path, process::Command};

use serde_json::Value;

use crate::{EXAMPLE, WHOLE, commands::code_and_lines};

const PAGE: &str = include_str!("../../docs/pipelines.md");
const TOOL: &str = include_str!("../../docs/cook/DarnTool.ts");
const TASK: &str = include_str!("../../docs/cook/MendMeshTask.ts");
const RECIPE: &str = include_str!("../../docs/cook/mend.json");
const TOOLS: &str = include_str!("../../docs/cook/tools.json");

/// The line of the page that Cook runs.
fn command_line() -> &'static str {
    let mut lines = PAGE
        .lines()
        .filter(|line| line.starts_with("\"${executable}\" inpaint"));
    let line = lines.next().expect("the page has the line");
    assert_eq!(lines.next(), None);
    line
}

/// Runs the line as Cook does, by a shell; the exit code and the lines of standard output.
fn run(scan: &Path, output: &Path, report: &Path) -> (Option<i32>, Vec<Value>) {
    let mut line = command_line().to_owned();
    for (name, path) in [
        ("executable", Path::new(env!("CARGO_BIN_EXE_darn"))),
        ("inputFile", scan),
        ("outputFile", output),
        ("reportFile", report),
    ] {
        let place = format!("${{{name}}}");
        assert!(line.contains(&place), "{line}");
        line = line.replace(&place, path.to_str().expect("a name"));
    }
    let ran = Command::new("sh").args(["-c", &line]).output();
    code_and_lines(ran.expect("a shell"))
}

#[test]
fn the_documented_command_line_mends_copies_and_fails_as_documented() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("my scan.glb"), EXAMPLE).expect("written");
    let (code, lines) = run(&path("my scan.glb"), &path("out.glb"), &path("r.json"));
    assert_eq!(code, Some(0));
    let (last, stages) = lines.split_last().expect("lines");
    assert!(!stages.is_empty() && stages.iter().all(|line| line["type"] == "stage"));
    assert_eq!(
        (&last["type"], &last["status"]),
        (&"report".into(), &"mended".into())
    );
    let report: Value =
        serde_json::from_slice(&std::fs::read(path("r.json")).expect("a report")).expect("JSON");
    assert_eq!(report, last["report"]);
    // What the task counts.
    assert!(TASK.contains("report.holes.length") && TASK.contains("report.skipped.length"));
    assert!(report["holes"].is_array() && report["skipped"].is_array());

    std::fs::write(path("whole.obj"), WHOLE).expect("written");
    let (code, lines) = run(&path("whole.obj"), &path("same.obj"), &path("none.json"));
    assert_eq!(code, Some(0));
    assert_eq!(
        lines.last().map(|line| line["status"] == "copied"),
        Some(true)
    );
    assert_eq!(
        std::fs::read(path("same.obj")).expect("a file"),
        WHOLE.as_bytes()
    );
    assert!(!path("none.json").exists());

    let (code, lines) = run(&path("missing.glb"), &path("no.glb"), &path("no.json"));
    assert_eq!(code, Some(1));
    let failed = lines.last().expect("a line");
    assert_eq!(
        (&failed["status"], &failed["code"]),
        (&"failed".into(), &"not_found".into())
    );
    assert!(failed["detail"].is_string());
}

#[test]
fn the_tool_runs_the_documented_command_line() {
    assert!(TOOL.contains(&format!("`{}`", command_line())));
}

/// The names in quotes of an expression.
fn quoted(expression: &str) -> impl Iterator<Item = &str> {
    expression.split('\'').skip(1).step_by(2)
}

/// By Cook's `recipe.schema.json`: which members a recipe and its steps have, and that steps name each other.
#[test]
fn the_recipe_is_one_of_cook() {
    let recipe: Value = serde_json::from_str(RECIPE).expect("JSON");
    let keys = |value: &Value| -> BTreeSet<String> {
        let object = value.as_object().expect("an object");
        object.keys().cloned().collect()
    };
    let set =
        |names: &[&str]| -> BTreeSet<String> { names.iter().map(ToString::to_string).collect() };
    let all = set(&[
        "id",
        "name",
        "description",
        "version",
        "parameterSchema",
        "start",
        "steps",
    ]);
    assert_eq!(keys(&recipe), all);
    assert_eq!(recipe["parameterSchema"]["additionalProperties"], false);
    let steps = recipe["steps"].as_object().expect("steps");
    assert!(steps.contains_key(recipe["start"].as_str().expect("a name")));
    let mut reached = BTreeSet::from([recipe["start"].as_str().expect("a name")]);
    for (name, step) in steps {
        let needed = set(&["task", "parameters", "success", "failure"]);
        let allowed = set(&["description", "skip", "pre", "post"]);
        let found = keys(step);
        assert!(found.is_superset(&needed), "{name}");
        assert!(
            found
                .iter()
                .all(|key| needed.contains(key) || allowed.contains(key)),
            "{name}"
        );
        for end in ["success", "failure"] {
            let next = step[end].as_str().expect("an expression");
            reached.extend(quoted(next));
            assert!(quoted(next).all(|next| steps.contains_key(next)), "{name}");
            assert!(
                quoted(next).next().is_some() || next == format!("${end}"),
                "{name}"
            );
        }
    }
    assert_eq!(reached.len(), steps.len(), "a step is never reached");
    // Its own step has the parameters of the task.
    let mend = &steps["mend"];
    let task = mend["task"].as_str().expect("a name");
    assert!(TASK.contains(&format!("taskName = \"{task}\"")));
    for parameter in keys(&mend["parameters"]) {
        assert!(
            TASK.contains(&format!("            {parameter}: {{ type:")),
            "{parameter}"
        );
    }
    for needed in ["inputMeshFile", "outputMeshFile", "reportFile"] {
        let given = mend["parameters"][needed].as_str().expect("an expression");
        if let Some(made) = given.strip_prefix("deliverables.") {
            assert!(mend["pre"]["deliverables"][made].is_string(), "{needed}");
        }
    }
}

#[test]
fn the_entry_of_the_tool_has_the_members_of_cooks_schema() {
    let tools: Value = serde_json::from_str(TOOLS).expect("JSON");
    let entry = &tools["Darn"];
    assert!(TOOL.contains("toolName = \"Darn\"") && TASK.contains("addTool(\"Darn\""));
    assert!(entry["executable"].is_string() && entry["version"].is_string());
    assert!(entry["maxInstances"].as_u64() >= Some(1) && entry["timeout"].is_u64());
    assert_eq!(entry.as_object().map(serde_json::Map::len), Some(4));
}
