//! JSON schemas of the contract's messages, from the descriptor that their Rust types were generated from.

use prost::Message as _;
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};
use serde_json::{Map, Value, json};

use darn_contract::v1;

const PACKAGE: &str = "darn.v1";
/// Fields whose numbers may be NaN, which is null in JSON.
const MAY_BE_NAN: [&str; 2] = ["map", "map_gradient"];
/// Messages that only gRPC uses.
const ONLY_GRPC: [&str; 9] = [
    "ScanChunk",
    "InpaintChunk",
    "StripChunk",
    "JobChunk",
    "JobLabels",
    "JobId",
    "JobQuery",
    "JobEventsQuery",
    "JobDeleted",
];
/// Field numbers in descriptor.proto, as paths of comments use them: messages and enums of a file, fields of a message.
const MESSAGES: i32 = 4;
const ENUMS: i32 = 5;
const FIELDS: i32 = 2;

/// A schema for each message and enum, by name, in the order of the file; without the messages that only gRPC uses.
pub(super) fn schemas() -> Map<String, Value> {
    // The build wrote the descriptor; if it were unreadable, the test of the committed document would fail.
    let set = FileDescriptorSet::decode(v1::DESCRIPTORS).unwrap_or_default();
    let Some(file) = set.file.iter().find(|file| file.package() == PACKAGE) else {
        return Map::new();
    };
    let messages = (0..)
        .zip(&file.message_type)
        .filter(|(_, message)| !ONLY_GRPC.contains(&message.name()));
    let messages =
        messages.map(|(i, message)| (message.name().to_owned(), object(file, i, message)));
    let enums = (0..)
        .zip(&file.enum_type)
        .map(|(i, e)| (e.name().to_owned(), enumeration(file, i, e)));
    messages.chain(enums).collect()
}

fn object(file: &FileDescriptorProto, index: i32, message: &DescriptorProto) -> Value {
    let properties: Map<String, Value> = (0..)
        .zip(&message.field)
        .map(|(i, field)| {
            let mut schema = property(field);
            let comment = comment(file, &[MESSAGES, index, FIELDS, i]);
            if !comment.is_empty() {
                schema["description"] = comment.into();
            }
            (field.json_name().to_owned(), schema)
        })
        .collect();
    json!({
        "type": "object",
        "description": comment(file, &[MESSAGES, index]),
        "properties": properties,
        "additionalProperties": false,
    })
}

fn enumeration(file: &FileDescriptorProto, index: i32, e: &EnumDescriptorProto) -> Value {
    let values: Vec<&str> = e.value.iter().map(|value| value.name()).collect();
    json!({ "type": "string", "description": comment(file, &[ENUMS, index]), "enum": values })
}

fn property(field: &FieldDescriptorProto) -> Value {
    let one = match field.r#type() {
        Type::Double if MAY_BE_NAN.contains(&field.name()) => json!({ "type": ["number", "null"] }),
        Type::Double | Type::Float => json!({ "type": "number" }),
        Type::Bool => json!({ "type": "boolean" }),
        Type::Uint32 | Type::Fixed32 => json!({ "type": "integer", "minimum": 0 }),
        Type::Int32 | Type::Sint32 | Type::Sfixed32 => json!({ "type": "integer" }),
        Type::Bytes => json!({ "type": "string", "contentEncoding": "base64" }),
        Type::Message | Type::Enum => match field.type_name().strip_prefix(".darn.v1.") {
            Some(name) => json!({ "$ref": format!("#/components/schemas/{name}") }),
            None if field.type_name().ends_with(".Timestamp") => {
                json!({ "type": "string", "format": "date-time" })
            }
            // The only other message used from elsewhere is google.protobuf.ListValue.
            None => json!({ "type": "array", "items": { "type": "number" } }),
        },
        // 64-bit numbers are strings in proto3 JSON.
        _ => json!({ "type": "string" }),
    };
    match field.label() {
        Label::Repeated => json!({ "type": "array", "items": one }),
        _ => one,
    }
}

fn comment(file: &FileDescriptorProto, path: &[i32]) -> String {
    (file.source_code_info.iter())
        .flat_map(|info| &info.location)
        .find(|location| location.path == path)
        .map(|location| location.leading_comments())
        .unwrap_or_default()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}
