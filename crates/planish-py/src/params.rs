//! Keywords made from the parameter structs of the stages, as the options of the command line are: a field is a keyword
//! with the field's default, range and unit. Nothing about a parameter is declared a second time.
//!
//! A field that is one of several things (`resolution`: a tolerance or control points) becomes one keyword for each; where two
//! stages have a field of one name, the keyword has its stage in front (`fit_smoothing`). Both as on the command line,
//! which a test of the package holds it to.

use planish::pipeline::PipelineParams;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

/// A stage's parameter struct with the name of its stage.
pub trait Stage: Default + Serialize + DeserializeOwned + JsonSchema {
    /// The name, also that of its options on the command line.
    const NAME: &'static str;
}

macro_rules! stages {
    ($($params:ty => $name:literal),* $(,)?) => {
        $(impl Stage for $params {
            const NAME: &'static str = $name;
        })*

        /// The keywords that each stage has.
        fn all() -> BTreeMap<&'static str, Arc<Vec<Field>>> {
            BTreeMap::from([$(($name, fields::<$params>())),*])
        }

        /// The JSON schema of a stage's parameters: types, ranges, units and descriptions.
        ///
        /// Raises KeyError for a name that is no stage; `keywords()` has them all.
        #[pyfunction]
        pub fn schema<'py>(py: Python<'py>, stage: &str) -> PyResult<Bound<'py, PyAny>> {
            match stage {
                $($name => crate::json::to(py, &schemars::schema_for!($params)),)*
                _ => Err(pyo3::exceptions::PyKeyError::new_err(format!("{stage} is no stage with parameters"))),
            }
        }
    };
}

stages! {
    planish::cloud::CleanParams => "clean", planish::cloud::ProjectParams => "points",
    planish::pipeline::ScanParams => "scan", planish::contour::ContourParams => "contour",
    planish::field::GridParams => "volume", planish::mesh::SmoothParams => "smooth",
    planish::mesh::DecimateParams => "decimate", planish::mesh::CompareParams => "compare",
    planish::mend::MendParams => "mend", planish::layout::LayoutParams => "layout", planish::grid::GridParams => "grid",
    planish::surface::FitParams => "fit", planish::surface::StitchParams => "stitch",
    planish::curve::PaintParams => "paint", planish::curve::SnakeParams => "snake",
    planish::synthetic::ScannerParams => "scanner",
}

/// The keywords of each stage's parameters, in the order of its schema.
#[pyfunction]
pub fn keywords(py: Python) -> PyResult<Bound<PyDict>> {
    let found = PyDict::new(py);
    for (stage, fields) in all() {
        found.set_item(stage, fields.iter().map(|f| f.keyword.clone()).collect::<Vec<_>>())?;
    }
    Ok(found)
}

/// Fields that more than one stage of the pipeline has, and those of groups of options of the command line.
const PREFIXED: [&str; 2] = ["smoothing", "close"];

/// One keyword.
struct Field {
    keyword: String,
    name: String,
    /// The variant of an enum field that the keyword stands for.
    variant: Option<String>,
    kind: Kind,
}

enum Kind {
    Flag,
    Whole(Range),
    Real(Range),
    Word(Vec<String>),
    Wholes,
    /// Patches, each with two numbers of control points.
    PerPatch,
}

#[derive(Clone, Copy, Default)]
struct Range {
    min: Option<f64>,
    max: Option<f64>,
    above: Option<f64>,
}

/// The keywords that a caller gave, taken stage by stage.
pub struct Given {
    function: &'static str,
    values: Map<String, Value>,
    known: Vec<String>,
}

impl Given {
    /// The keywords of a call of `function`; those that are None are as if not given.
    /// # Errors
    /// TypeError, ValueError for values that are no parameters of anything.
    pub fn new(function: &'static str, keywords: Option<&Bound<PyDict>>) -> PyResult<Given> {
        let mut values = Map::new();
        for (name, value) in keywords.into_iter().flatten().filter(|(_, value)| !value.is_none()) {
            let name: String = name.extract()?;
            let json = crate::json::of(&value).map_err(|e| named(value.py(), &name, e))?;
            values.insert(name, json);
        }
        Ok(Given { function, values, known: Vec::new() })
    }

    /// The parameters of a stage: its defaults with what was given in place.
    /// # Errors
    /// TypeError, ValueError with the keyword's name.
    pub fn take<P: Stage>(&mut self) -> PyResult<P> {
        self.take_over(P::default())
    }

    /// The parameters of a stage: `base` with what was given in place.
    /// # Errors
    /// As [`Given::take`].
    pub fn take_over<P: Stage>(&mut self, base: P) -> PyResult<P> {
        let internal = |e: serde_json::Error| PyValueError::new_err(format!("parameters of {}: {e}", P::NAME));
        let mut params = serde_json::to_value(base).map_err(internal)?;
        let mut rivals: HashMap<&str, &str> = HashMap::new();
        let fields = fields::<P>();
        for field in fields.iter() {
            self.known.push(field.keyword.clone());
            let Some(value) = self.values.remove(&field.keyword) else { continue };
            field.check(&value)?;
            if let Some(rival) = rivals.insert(&field.name, &field.keyword) {
                let what = format!("{}() takes {rival} or {}, not both", self.function, field.keyword);
                return Err(PyTypeError::new_err(what));
            }
            params[&field.name] = match &field.variant {
                Some(variant) => Value::Object(Map::from_iter([(variant.clone(), value)])),
                None => value,
            };
        }
        serde_json::from_value(params).map_err(internal)
    }

    /// Refuses what no stage took.
    /// # Errors
    /// TypeError that names the keyword and those that there are.
    pub fn done(self) -> PyResult<()> {
        let Some(name) = self.values.keys().next() else { return Ok(()) };
        let known = self.known.join(", ");
        let what = format!("{}() got an unexpected keyword argument '{name}'; it takes {known}", self.function);
        Err(PyTypeError::new_err(what))
    }
}

/// The parameters of all stages after the mesh: `base` with what was given in place.
pub fn pipeline_params(
    function: &'static str,
    base: PipelineParams,
    parameters: Option<&Bound<PyDict>>,
) -> PyResult<PipelineParams> {
    let mut given = Given::new(function, parameters)?;
    let params = take_pipeline(&mut given, base)?;
    given.done()?;
    Ok(params)
}

/// Takes the parameters of all stages after the mesh.
pub fn take_pipeline(given: &mut Given, base: PipelineParams) -> PyResult<PipelineParams> {
    Ok(PipelineParams {
        mend: given.take_over(base.mend)?,
        layout: given.take_over(base.layout)?,
        grid: given.take_over(base.grid)?,
        fit: given.take_over(base.fit)?,
        stitch: given.take_over(base.stitch)?,
    })
}

/// The same exception with the keyword's name in front.
fn named(py: Python, name: &str, error: PyErr) -> PyErr {
    let text = format!("{name}: {}", error.value(py));
    if error.is_instance_of::<PyValueError>(py) { PyValueError::new_err(text) } else { PyTypeError::new_err(text) }
}

impl Field {
    /// Refuses a value of another type, or outside the range.
    fn check(&self, value: &Value) -> PyResult<()> {
        let shown = || format!("{}={value}", self.keyword).replace('"', "'");
        let range = |x: f64, range: &Range, whole: &str| {
            let Range { min, max, above } = *range;
            if min.is_some_and(|m| x < m) || max.is_some_and(|m| x > m) || above.is_some_and(|a| x <= a) {
                let wanted = match (min, max, above) {
                    (_, _, Some(a)) => format!("above {a}"),
                    (Some(a), Some(b), _) => format!("from {a} to {b}"),
                    (Some(a), None, _) => format!("of at least {a}"),
                    (_, Some(b), _) => format!("of at most {b}"),
                    _ => String::new(),
                };
                return Err(PyValueError::new_err(format!("{}: a {whole}number {wanted} is needed", shown())));
            }
            Ok(())
        };
        let wrong = |what: &str| Err(PyTypeError::new_err(format!("{}: {what} is needed", shown())));
        match (&self.kind, value) {
            (Kind::Flag, Value::Bool(_)) => Ok(()),
            (Kind::Flag, _) => wrong("True or False"),
            (Kind::Whole(limits), Value::Number(n)) if !n.is_f64() => {
                range(n.as_f64().unwrap_or(0.0), limits, "whole ")
            }
            (Kind::Whole(_), _) => wrong("a whole number"),
            (Kind::Real(limits), Value::Number(n)) => range(n.as_f64().unwrap_or(0.0), limits, ""),
            (Kind::Real(_), _) => wrong("a number"),
            (Kind::Word(words), Value::String(word)) if words.contains(word) => Ok(()),
            (Kind::Word(words), Value::String(_)) => {
                Err(PyValueError::new_err(format!("{}: one of {} is needed", shown(), words.join(", "))))
            }
            (Kind::Word(_), _) => wrong("a word"),
            (Kind::Wholes, Value::Array(items)) if items.iter().all(|i| i.is_u64()) => Ok(()),
            (Kind::Wholes, _) => wrong("a list of whole numbers"),
            (Kind::PerPatch, Value::Array(items)) if items.iter().all(is_triple) => Ok(()),
            (Kind::PerPatch, _) => wrong("a list of (patch, control points along u, along v)"),
        }
    }
}

fn is_triple(value: &Value) -> bool {
    value.as_array().is_some_and(|three| three.len() == 3 && three.iter().all(Value::is_u64))
}

/// The keywords of each stage.
type Keywords = HashMap<&'static str, Arc<Vec<Field>>>;

/// The keywords of `P`, made once.
fn fields<P: Stage>() -> Arc<Vec<Field>> {
    static MADE: LazyLock<Mutex<Keywords>> = LazyLock::new(Mutex::default);
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(P::NAME).or_insert_with(|| Arc::new(read::<P>())).clone()
}

fn read<P: Stage>() -> Vec<Field> {
    let schema = schemars::schema_for!(P);
    let schema = schema.as_value();
    let mut found = Vec::new();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        // What the command line sets by hand (memory, holes) is a keyword by hand here, too.
        if property["by_hand"] == true {
            continue;
        }
        if let Some(kind) = kind_of(property, schema) {
            let is_prefixed = PREFIXED.contains(&name.as_str());
            let keyword = if is_prefixed { format!("{}_{name}", P::NAME) } else { name.clone() };
            found.push(Field { keyword, name: name.clone(), variant: None, kind });
            continue;
        }
        for one in named_definition(property, schema)["oneOf"].as_array().into_iter().flatten() {
            let Some((variant, content)) = one["properties"].as_object().and_then(|p| p.iter().next()) else {
                continue;
            };
            if let Some(kind) = kind_of(content, schema) {
                let variant = variant.clone();
                found.push(Field { keyword: variant.clone(), name: name.clone(), variant: Some(variant), kind });
            }
        }
    }
    found
}

/// The definition that a property refers to, if it does; one that may be absent, too.
fn named_definition<'a>(property: &'a Value, schema: &'a Value) -> &'a Value {
    let inner = property["anyOf"].as_array().and_then(|any| any.iter().find(|p| p["$ref"].is_string()));
    let property = inner.unwrap_or(property);
    match property["$ref"].as_str().and_then(|r| r.rsplit('/').next()) {
        Some(name) => &schema["$defs"][name],
        None => property,
    }
}

/// The kind of a property; `None` for structs and for enums with contents.
fn kind_of(property: &Value, schema: &Value) -> Option<Kind> {
    let property = named_definition(property, schema);
    let mut words = Vec::new();
    for word in property["enum"].as_array().into_iter().flatten() {
        words.push(word.as_str()?.to_owned());
    }
    for one in property["oneOf"].as_array().into_iter().flatten() {
        words.push(one["const"].as_str()?.to_owned());
    }
    if !words.is_empty() {
        return Some(Kind::Word(words));
    }
    let types: Vec<&str> = match &property["type"] {
        Value::String(one) => vec![one],
        Value::Array(many) => many.iter().filter_map(Value::as_str).collect(),
        _ => return None,
    };
    let [min, max, above] = ["minimum", "maximum", "exclusiveMinimum"].map(|key| property[key].as_f64());
    let range = Range { min, max, above };
    match types.into_iter().find(|t| *t != "null")? {
        "boolean" => Some(Kind::Flag),
        "integer" => Some(Kind::Whole(range)),
        "number" => Some(Kind::Real(range)),
        "array" if property["per_patch"] == true => Some(Kind::PerPatch),
        "array" if property["items"]["type"] == "integer" => Some(Kind::Wholes),
        _ => None,
    }
}
