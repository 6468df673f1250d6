//! The schemas in docs/schema are those of the types, and what the program writes obeys them.
#![expect(clippy::disallowed_methods, reason = "looks at the project's files")]
#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::Value;
use std::path::Path;

fn kept(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schema").join(format!("{name}.schema.json"))
}

/// A schema that changed is a change for everybody who reads the file: a new version where old readers would break.
/// `GENU_BLESS=1 cargo test --test integration schema` writes them anew.
#[test]
fn the_kept_schemas_are_those_of_the_types() {
    for name in genu::schema::names() {
        let now = genu::schema::schema(name).unwrap();
        if std::env::var_os("GENU_BLESS").is_some() {
            std::fs::create_dir_all(kept(name).parent().unwrap()).unwrap();
            std::fs::write(kept(name), &now).unwrap();
        }
        let kept = std::fs::read_to_string(kept(name)).unwrap_or_default();
        assert!(kept == now, "docs/schema/{name}.schema.json is not what the types say; GENU_BLESS=1 writes it anew");
    }
}

/// A package of this crate alone has no other sources beside it: it brings what their comments say of the options. The same command writes them anew.
#[test]
fn the_kept_comments_of_options_are_those_of_the_sources() {
    let (now, path) = (
        include_str!(concat!(env!("OUT_DIR"), "/option_comments.rs")),
        Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline/option_comments.rs"),
    );
    if std::env::var_os("GENU_BLESS").is_some() {
        std::fs::write(&path, now).unwrap();
    }
    let kept = std::fs::read_to_string(path).unwrap_or_default();
    assert!(kept == now, "pipeline/option_comments.rs is not what the sources say; GENU_BLESS=1 writes it anew");
}

/// Whether `value` has what `schema` requires and nothing that it does not know; follows references and alternatives.
pub(crate) fn obeys(value: &Value, schema: &Value, root: &Value) -> Result<(), String> {
    if let Some(reference) = schema["$ref"].as_str() {
        let name = reference.trim_start_matches("#/$defs/");
        return obeys(value, &root["$defs"][name], root);
    }
    for several in ["anyOf", "oneOf"] {
        if let Some(all) = schema[several].as_array() {
            let told: Vec<_> = all.iter().map(|s| obeys(value, s, root)).collect();
            if told.iter().all(Result::is_err) {
                return Err(format!("{value}: none of {several}: {told:?}"));
            }
        }
    }
    if let Some(stated) = schema.get("const") {
        (stated == value).then_some(()).ok_or(format!("{value} is not {stated}"))?;
    }
    if let Some(stated) = schema["enum"].as_array() {
        stated.contains(value).then_some(()).ok_or(format!("{value} is none of {stated:?}"))?;
    }
    let types: Vec<&str> = match &schema["type"] {
        Value::String(one) => vec![one.as_str()],
        Value::Array(all) => all.iter().filter_map(Value::as_str).collect(),
        _ => vec![],
    };
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(_) => "number",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let whole = value.as_i64().is_some() || value.as_u64().is_some();
    let fits = types.is_empty() || types.contains(&kind) || (whole && types.contains(&"integer"));
    if !fits {
        return Err(format!("{value} is no {types:?}"));
    }
    if let Some(items) = value.as_array().filter(|_| schema.get("items").is_some_and(Value::is_object)) {
        items.iter().try_for_each(|v| obeys(v, &schema["items"], root))?;
    }
    let Some(map) = value.as_object() else { return Ok(()) };
    for name in schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str) {
        map.contains_key(name).then_some(()).ok_or(format!("{name} is missing"))?;
    }
    for (name, inner) in map {
        match (&schema["properties"][name], schema.get("additionalProperties")) {
            (Value::Null, Some(Value::Bool(false))) => return Err(format!("{name} is not in the schema")),
            (Value::Null, Some(other)) if other.is_object() => obeys(inner, other, root)?,
            (Value::Null, _) => {}
            (own, _) => obeys(inner, own, root).map_err(|e| format!("{name}: {e}"))?,
        }
    }
    Ok(())
}

#[test]
fn a_model_obeys_its_schema_and_a_wrong_one_does_not() {
    let schema: Value = serde_json::from_str(&genu::schema::schema("model").unwrap()).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/model.json");
    let model: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    obeys(&model, &schema, &schema).unwrap();
    let broken = |change: &dyn Fn(&mut Value)| {
        let mut other = model.clone();
        change(&mut other);
        obeys(&other, &schema, &schema).unwrap_err()
    };
    assert!(broken(&|m| m["bundles"][0]["stiffness_n_per_mm"] = "stiff".into()).contains("stiff"));
    assert!(broken(&|m| m["friktion"] = 1.into()).contains("friktion"));
    assert!(broken(&|m| m["schema"] = "model/0".into()).contains("model/0"));
    assert!(broken(&|m| drop(m.as_object_mut().unwrap().remove("fibres"))).contains("fibres"));
}
