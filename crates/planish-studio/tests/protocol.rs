//! The types of the page, written from the schema of the messages; and golden messages that both sides read.
//!
//! `PLANISH_TYPES=write cargo test --release --workspace --test protocol` writes them anew.

use planish_studio::protocol::{Message, Request, State, frame};
use schemars::SchemaGenerator;
use schemars::generate::SchemaSettings;
use serde_json::{Map, Value};
use std::path::{Path, PathBuf};

const HEAD: &str = "// Written from the Rust types by a test of planish-studio (PLANISH_TYPES=write): not by hand.\n";

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// All types as TypeScript.
fn typescript() -> String {
    let mut generator: SchemaGenerator = SchemaSettings::draft2020_12().into_generator();
    generator.subschema_for::<Request>();
    generator.subschema_for::<Message>();
    generator.subschema_for::<State>();
    generator.subschema_for::<frame::Header>();
    let mut text = String::from(HEAD);
    for (name, schema) in generator.take_definitions(true) {
        text.push('\n');
        if let Some(words) = schema.get("description").and_then(Value::as_str) {
            text.push_str(&comment(words, ""));
        }
        text.push_str(&format!("export type {name} = {};\n", of(&schema)));
    }
    text
}

fn comment(words: &str, indent: &str) -> String {
    format!("{indent}/** {} */\n", words.split_whitespace().collect::<Vec<_>>().join(" "))
}

/// A schema as a type.
fn of(schema: &Value) -> String {
    let Some(map) = schema.as_object() else { return "unknown".into() };
    let mut parts: Vec<String> = Vec::new();
    if let Some(name) = map.get("$ref").and_then(Value::as_str) {
        parts.push(name.rsplit('/').next().unwrap_or_default().into());
    }
    if let Some(value) = map.get("const") {
        return value.to_string();
    }
    if let Some(values) = map.get("enum").and_then(Value::as_array) {
        return values.iter().map(Value::to_string).collect::<Vec<_>>().join(" | ");
    }
    for key in ["oneOf", "anyOf"] {
        if let Some(list) = map.get(key).and_then(Value::as_array) {
            let all: Vec<String> = list.iter().map(of).collect();
            parts.push(format!("({})", all.join(" | ")));
        }
    }
    match map.get("type") {
        Some(Value::Array(kinds)) => {
            let kinds: Vec<String> = kinds.iter().filter_map(Value::as_str).map(|k| kind(k, map)).collect();
            parts.push(kinds.join(" | "));
        }
        Some(Value::String(name)) if name != "object" || has_fields(map) || parts.is_empty() => {
            parts.push(kind(name, map));
        }
        _ => {}
    }
    if parts.is_empty() { "unknown".into() } else { parts.join(" & ") }
}

fn has_fields(map: &Map<String, Value>) -> bool {
    map.get("properties").and_then(Value::as_object).is_some_and(|p| !p.is_empty())
}

fn kind(name: &str, map: &Map<String, Value>) -> String {
    match name {
        "integer" | "number" => "number".into(),
        "array" => array(map),
        "object" => object(map),
        other => other.into(),
    }
}

/// Longest array of fixed length that is written as a tuple.
const TUPLE: u64 = 4;

fn array(map: &Map<String, Value>) -> String {
    let number = |key: &str| map.get(key).and_then(Value::as_u64);
    if let Some(items) = map.get("prefixItems").and_then(Value::as_array) {
        return format!("[{}]", items.iter().map(of).collect::<Vec<_>>().join(", "));
    }
    let item = map.get("items").map_or("unknown".into(), of);
    match (number("minItems"), number("maxItems")) {
        (Some(a), Some(b)) if a == b && a <= TUPLE => format!("[{}]", vec![item; a as usize].join(", ")),
        _ if item.contains(['|', '&']) => format!("({item})[]"),
        _ => format!("{item}[]"),
    }
}

fn object(map: &Map<String, Value>) -> String {
    let required: Vec<&str> =
        map.get("required").and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str).collect();
    if !has_fields(map) {
        return match map.get("additionalProperties") {
            Some(value) if value.is_object() => format!("{{ [key: string]: {} }}", of(value)),
            _ => "Record<string, never>".into(),
        };
    }
    let mut text = String::from("{\n");
    for (name, field) in map["properties"].as_object().into_iter().flatten() {
        if let Some(words) = field.get("description").and_then(Value::as_str) {
            text.push_str(&comment(words, "  "));
        }
        let optional = if required.contains(&name.as_str()) { "" } else { "?" };
        text.push_str(&format!("  {name}{optional}: {};\n", of(field)));
    }
    text + "}"
}

#[test]
fn the_types_of_the_page_are_those_of_the_server() {
    let path = root("studio/src/protocol/types.ts");
    let text = typescript();
    if std::env::var("PLANISH_TYPES").is_ok_and(|v| v == "write") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &text).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(there == text, "studio/src/protocol/types.ts is old: run this test with PLANISH_TYPES=write");
}

#[test]
fn golden_messages_read_and_write_the_same() {
    let read = |name: &str| -> Vec<Value> {
        let text = std::fs::read_to_string(root("protocol").join(name)).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    // What is left out has its usual value: a message is the same after the second reading.
    for value in read("requests.json") {
        let request: Request = serde_json::from_value(value.clone()).unwrap_or_else(|e| panic!("{e}: {value}"));
        let again: Request = serde_json::from_value(serde_json::to_value(&request).unwrap()).unwrap();
        assert_eq!(request, again, "{value}");
        assert_eq!(Some(request.id() as u64), value["id"].as_u64());
    }
    for value in read("messages.json") {
        let message: Message = serde_json::from_value(value.clone()).unwrap_or_else(|e| panic!("{e}: {value}"));
        assert_eq!(serde_json::to_value(&message).unwrap(), value);
    }
    for value in read("wrong.json") {
        assert!(serde_json::from_value::<Request>(value.clone()).is_err(), "{value}");
    }
}
