//! Maps of anchor searches that come as they are computed: whole, cancelled, behind edits, broken off.

use std::time::Duration;

use reqwest::Response;
use serde_json::{Value, json};

use crate::fake::{Behaviour, MAP_CELLS};
use crate::harness::{Service, until};

const MAP: &str = r#"{"target": [0.25, 0, 0], "map": true}"#;

async fn asked(service: &Service, session: &str, query: &str) -> Response {
    let search = format!("{session}/optimize-anchor");
    let asked = service.ask(&search, query.to_owned());
    let answer = asked.header("accept", "application/x-ndjson").send().await;
    answer.unwrap()
}

fn lines(text: &str) -> Vec<Value> {
    let each = text.lines().map(serde_json::from_str);
    each.collect::<Result<_, _>>().unwrap()
}

#[tokio::test]
async fn the_place_comes_first_then_every_cell_once() {
    let service = Service::start(&[]).await;
    let session = service.session("cloth").await;
    let answer = asked(&service, &session, MAP).await;
    assert_eq!(answer.headers()["content-type"], "application/x-ndjson");
    let lines = lines(&answer.text().await.unwrap());
    assert_eq!(lines[0]["found"]["distance"], 0.25);
    assert_eq!(lines[0]["found"]["map"], json!([]));
    let pieces = || lines[1..].iter().map(|line| &line["map"]);
    assert!(pieces().count() > 10);
    assert!(pieces().all(|piece| piece["total"] == MAP_CELLS));
    let numbers = |member: &'static str| {
        let lists = pieces().flat_map(move |piece| piece[member].as_array().unwrap());
        lists.map(|n| n.as_f64().unwrap()).collect::<Vec<_>>()
    };
    let all: Vec<f64> = (0..MAP_CELLS).map(|k| k as f64).collect();
    assert_eq!(numbers("cells"), all);
    assert_eq!(numbers("losses"), all);

    let place = asked(&service, &session, r#"{"target": [0.25, 0, 0]}"#).await;
    assert_eq!(place.text().await.unwrap().lines().count(), 1);
    let refused = asked(&service, &session, "{}").await;
    assert_eq!(refused.status(), 422);
}

#[tokio::test]
async fn a_closed_request_ends_its_map() {
    let service = Service::start(&[]).await;
    let session = service.session("cloth").await;
    let mut answer = asked(&service, &session, MAP).await;
    answer.chunk().await.unwrap();
    drop(answer);
    let in_use = || async { service.metric("darn_session_requests").await };
    until(|| async { in_use().await == Some(0.0) }).await;
    tokio::time::sleep(Duration::from_millis(100)).await;
    let told = service.fake.map_pieces();
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert_eq!(service.fake.map_pieces(), told);
    assert!(told * 8 < MAP_CELLS, "{told} pieces");
}

#[tokio::test]
async fn edits_go_before_a_map_that_still_becomes_whole() {
    let service = Service::start(&[]).await;
    let session = service.session("cloth").await;
    let mut answer = asked(&service, &session, MAP).await;
    let mut text = answer.chunk().await.unwrap().unwrap().to_vec();
    let edit = format!("{session}/inpaint");
    let anchor = json!({ "anchors": [{ "uv": [0.5, 0.5], "position": [1, 0, 0] }] }).to_string();
    let draft = format!("{edit}?draft=true");
    for path in [&edit, &draft, &draft, &edit, &draft] {
        let edited = service.ask(path, anchor.clone()).send().await.unwrap();
        assert_eq!(edited.status(), 200);
        let told = service.fake.map_pieces();
        tokio::time::sleep(Duration::from_millis(60)).await;
        assert_eq!(service.fake.map_pieces(), told, "no piece between edits");
    }
    while let Some(more) = answer.chunk().await.unwrap() {
        text.extend(more);
    }
    let lines = lines(std::str::from_utf8(&text).unwrap());
    let cells = lines
        .iter()
        .filter_map(|line| line["map"]["cells"].as_array());
    assert_eq!(cells.map(Vec::len).sum::<usize>(), MAP_CELLS);
}

#[tokio::test]
async fn what_goes_wrong_on_the_way_is_the_last_line() {
    let service = Service::start(&[]).await;
    let session = service.session("cloth").await;
    for (behaviour, code) in [
        (Behaviour::RefuseNotADisk, "not_a_disk"),
        (Behaviour::Panic, "internal"),
    ] {
        service.fake.next_piece(Behaviour::Mend);
        service.fake.next_piece(behaviour);
        let answer = asked(&service, &session, MAP).await;
        let lines = lines(&answer.text().await.unwrap());
        assert_eq!(lines.len(), 3, "{code}");
        assert_eq!(lines[2]["problem"]["code"], code);
    }
}
