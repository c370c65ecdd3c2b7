//! Options of a stage, made from the stage's parameter struct: its fields become flags, its doc comments
//! their help, its defaults and ranges theirs. Nothing about a parameter is declared a second time.
//!
//! A field `feature_angle_deg` becomes `--feature-angle-deg`; where two stages have a field of one name, or a group of
//! options written by hand has an option of it, the flag has its stage in front (`--fit-smoothing`, `--volume-close`):
//! of two options of one name one would do nothing. A field that is one of several
//! things (`resolution`: a tolerance or control points) becomes one flag for each, of which one may be given.

use crate::args::groups::{Common, HoleArgs, ScanArgs};
use crate::failure::Failure;
use crate::tolerance::{self, Scale, Tolerance};
use crate::words::{self, with_hint};
use clap::builder::{PossibleValuesParser, ValueParser};
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use planish::pipeline::PipelineParams;
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use std::marker::PhantomData;

/// Fields that common options set: they get no flag of their own. Nor do those whose schema says `by_hand`, which groups of
/// options in `args` set.
const COMMON_FIELDS: [&str; 1] = ["seed"];

/// A stage's parameter struct, with its name: that of its options in [`PipelineParams`] and in what is told of them.
pub trait StageParams: Default + Serialize + DeserializeOwned + JsonSchema {
    /// Name of the stage.
    const STAGE: &'static str;
    /// Heading of its options in the help.
    const HEADING: &'static str;

    /// Checks what a range of one value alone cannot: values against each other.
    /// # Errors
    /// What does not go together.
    fn validate(&self) -> Result<(), String> {
        Ok(())
    }
}

/// The options of one stage as the user gave them.
#[derive(Clone, Debug)]
pub struct StageOptions<P> {
    given: Map<String, Value>,
    params: PhantomData<P>,
}

impl<P: StageParams> StageOptions<P> {
    /// The stage's parameters: its defaults with the given options in place.
    /// # Errors
    /// If the stage refuses a value.
    pub fn params(&self, seed: Option<u64>) -> Result<P, Failure> {
        self.params_over(P::default(), seed)
    }

    /// The stage's parameters: `base` with the given options in place.
    /// # Errors
    /// If the stage refuses a value.
    pub fn params_over(&self, base: P, seed: Option<u64>) -> Result<P, Failure> {
        self.params_at(base, seed, Scale::UNKNOWN)
    }

    /// As [`StageOptions::params_over`], with tolerances meant for an input of a known size.
    /// # Errors
    /// If the stage refuses a value.
    pub fn params_at(&self, base: P, seed: Option<u64>, scale: Scale) -> Result<P, Failure> {
        let wrong = |e: &dyn std::fmt::Display| Failure::usage(format!("options of the {} stage", P::STAGE), e);
        let params = self.merge(base, seed, scale).map_err(|e| wrong(&e))?;
        params.validate().map_err(|e| wrong(&with_hint(&e)))?;
        Ok(params)
    }

    /// What the user gave for `variant` of the field `name`, if anything.
    pub fn given(&self, name: &str, variant: &str) -> Option<&Value> {
        self.given.get(name)?.get(variant)
    }

    /// The whole number given for the field `name`, if the user gave one.
    pub fn asked(&self, name: &str) -> Option<u64> {
        self.given.get(name)?.as_u64()
    }

    /// The number given for the field `name`, if the user gave one.
    pub fn number(&self, name: &str) -> Option<f64> {
        self.given.get(name)?.as_f64()
    }

    /// The tolerance that the user gave, if it is the field `name` that takes one.
    pub fn given_tolerance(&self, name: &str) -> Option<Tolerance> {
        self.given(name, "tolerance")?.as_str()?.parse().ok()
    }

    /// The first option that the user gave, as it is written on the command line.
    pub fn first_given(&self) -> Option<String> {
        let field = fields::<P>().into_iter().find(|f| self.given.contains_key(&f.name))?;
        Some(format!("--{}", field.flag))
    }

    fn merge(&self, base: P, seed: Option<u64>, scale: Scale) -> Result<P, serde_json::Error> {
        let mut fields = serde_json::to_value(base)?;
        if let Value::Object(fields) = &mut fields {
            fields.extend(self.given.clone());
            for field in self::fields::<P>() {
                let (Kind::Tolerance(of), Some(variant)) = (&field.kind, &field.variant) else { continue };
                let given = self.given(&field.name, variant).and_then(Value::as_str);
                if let Some(tolerance) = given.and_then(|text| text.parse::<Tolerance>().ok()) {
                    let x = match of {
                        Of::Share => tolerance.share(scale),
                        Of::Length => tolerance.length(scale),
                    };
                    fields.insert(field.name, Value::Object(Map::from_iter([(variant.clone(), x.into())])));
                }
            }
            if let (Some(seed), true) = (seed, fields.contains_key("seed")) {
                fields.insert("seed".into(), seed.into());
            }
        }
        serde_json::from_value(fields)
    }
}

impl<P: StageParams> FromArgMatches for StageOptions<P> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut options = StageOptions { given: Map::new(), params: PhantomData };
        options.update_from_arg_matches(matches)?;
        Ok(options)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        for field in fields::<P>() {
            if let Some(text) = matches.get_one::<String>(&field.id) {
                let value = field.read(text).map_err(|e| clap::Error::raw(ErrorKind::ValueValidation, e))?;
                let value = match field.variant {
                    Some(variant) => Value::Object(Map::from_iter([(variant, value)])),
                    None => value,
                };
                self.given.insert(field.name, value);
            }
        }
        Ok(())
    }
}

impl<P: StageParams> Args for StageOptions<P> {
    fn augment_args(mut command: Command) -> Command {
        for field in fields::<P>() {
            command = command.arg(field.arg().help_heading(P::HEADING));
        }
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// Checks parameters that did not come from the command line as those are checked: each in its range, then against each other.
/// # Errors
/// The first that the command line would refuse.
pub fn check_stored<P: StageParams>(params: &P) -> Result<(), String> {
    let json = serde_json::to_value(params).map_err(|e| e.to_string())?;
    for field in fields::<P>() {
        let value = match &field.variant {
            Some(variant) => &json[&field.name][variant],
            None => &json[&field.name],
        };
        let text = match value {
            Value::Number(x) => x.to_string(),
            Value::Array(list) if list.iter().all(Value::is_array) => continue,
            Value::Array(list) => list.iter().map(Value::to_string).collect::<Vec<_>>().join(","),
            _ => continue,
        };
        field.read(&text)?;
    }
    params.validate()
}

/// One field of a parameter struct, as its schema describes it.
struct Field {
    name: String,
    /// The variant of an enum field that the flag stands for.
    variant: Option<String>,
    /// Ids of the other variants: one of them at most.
    rivals: Vec<String>,
    id: String,
    flag: String,
    help: String,
    kind: Kind,
    optional: bool,
}

#[derive(Clone)]
enum Kind {
    Flag,
    Whole {
        min: Option<f64>,
        max: Option<f64>,
    },
    Real {
        min: Option<f64>,
        max: Option<f64>,
        above: Option<f64>,
    },
    Choice(Vec<String>),
    Wholes {
        count: Option<usize>,
        min: Option<f64>,
        max: Option<f64>,
    },
    /// Two whole numbers at each of some patches: `12x8@17`.
    PerPatch,
    Tolerance(Of),
}

/// What the stage takes a tolerance as.
#[derive(Clone, Copy)]
enum Of {
    Share,
    Length,
}

impl Field {
    fn arg(&self) -> Arg {
        let parser = match &self.kind {
            Kind::Flag => ValueParser::from(PossibleValuesParser::new(["true", "false"])),
            Kind::Choice(words) => ValueParser::from(PossibleValuesParser::new(words.clone())),
            _ => ValueParser::string(),
        };
        let value_name = match self.kind {
            Kind::Flag => "true|false",
            Kind::Whole { .. } => "N",
            Kind::Real { .. } => "X",
            Kind::Choice(_) => "WORD",
            Kind::Wholes { .. } => "N,N",
            Kind::PerPatch => "NxN@PATCH",
            Kind::Tolerance(_) => "LENGTH|%",
        };
        let arg = Arg::new(self.id.clone()).long(self.flag.clone()).help(self.help.clone()).value_name(value_name);
        let arg = arg.value_parser(parser).action(ArgAction::Set).allow_negative_numbers(true);
        let arg = arg.conflicts_with_all(self.rivals.clone());
        if !matches!(self.kind, Kind::Flag) {
            return arg;
        }
        // The value needs its `=`: what follows the flag may be the input.
        arg.num_args(0..=1).require_equals(true).default_missing_value("true")
    }

    fn read(&self, text: &str) -> Result<Value, String> {
        let wrong =
            |need: &str| Err(format!("invalid value '{}' for '--{}': {need}\n", words::quoted(text), self.flag));
        let outside =
            |x: f64, min: &Option<f64>, max: &Option<f64>| min.is_some_and(|m| x < m) || max.is_some_and(|m| x > m);
        let range = |min: &Option<f64>, max: &Option<f64>| match (min, max) {
            (Some(a), Some(b)) => format!("a number from {a} to {b} is needed"),
            (Some(a), None) => format!("a number of at least {a} is needed"),
            (None, Some(b)) => format!("a number of at most {b} is needed"),
            _ => "a number is needed".into(),
        };
        let open_range = |above: f64, max: &Option<f64>| match max {
            Some(b) => format!("a number above {above} and up to {b} is needed"),
            None => format!("a number above {above} is needed"),
        };
        if self.optional && text == "none" {
            return Ok(Value::Null);
        }
        match &self.kind {
            Kind::Flag => Ok(Value::Bool(text == "true")),
            Kind::Choice(_) => Ok(Value::String(text.into())),
            Kind::Wholes { count, min, max } => {
                let numbers: Result<Vec<u64>, _> = text.split([',', 'x']).map(|n| n.trim().parse::<u64>()).collect();
                let fits = |numbers: &[u64]| numbers.iter().all(|&n| !outside(n as f64, min, max));
                match numbers {
                    Ok(numbers) if count.is_none_or(|c| c == numbers.len()) && fits(&numbers) => Ok(numbers.into()),
                    _ => {
                        let each = match (min, max) {
                            (Some(a), Some(b)) => format!(" from {a} to {b}"),
                            _ => String::new(),
                        };
                        let many = count.map_or(String::new(), |c| format!("{c} "));
                        wrong(&format!("{many}whole numbers{each} with commas between are needed"))
                    }
                }
            }
            Kind::PerPatch => {
                let one = |text: &str| -> Option<Value> {
                    let (control, patch) = text.trim().split_once('@')?;
                    let (along_u, along_v) = control.split_once('x')?;
                    let number = |text: &str| text.trim().parse::<u32>().ok();
                    let [u, v] = [number(along_u)?, number(along_v)?];
                    (u.min(v) >= 4 && u.max(v) <= 8193).then_some(())?;
                    Some([number(patch)?, u, v].as_slice().into())
                };
                let all: Option<Vec<Value>> = text.split(',').map(one).collect();
                all.map(Value::Array).ok_or(()).or_else(|()| {
                    wrong("control points along u and v at a patch are needed, each from 4 to 8193, as 12x8@17,6x6@3")
                })
            }
            Kind::Tolerance(_) => match text.parse::<Tolerance>() {
                Ok(tolerance) => Ok(Value::String(tolerance.to_string())),
                Err(_) => wrong(tolerance::WANTED),
            },
            Kind::Whole { min, max } => match text.parse::<i64>() {
                Ok(n) if !outside(n as f64, min, max) => Ok(n.into()),
                _ => wrong(&range(min, max).replace("a number", "a whole number")),
            },
            Kind::Real { min, max, above } => match text.parse::<f64>() {
                Ok(x) if x.is_finite() && !outside(x, min, max) && above.is_none_or(|a| x > a) => Ok(x.into()),
                _ => wrong(&above.map_or_else(|| range(min, max), |a| open_range(a, max))),
            },
        }
    }
}

/// The fields of `P` that can be given on the command line.
fn fields<P: StageParams>() -> Vec<Field> {
    let schema = schemars::schema_for!(P);
    let schema = schema.as_value();
    let defaults = serde_json::to_value(P::default()).unwrap_or_default();
    let clashes = clashing_names();
    let Some(properties) = schema["properties"].as_object() else { return Vec::new() };
    let mut found = Vec::new();
    let is_set_elsewhere = |name: &str, property: &Value| COMMON_FIELDS.contains(&name) || property["by_hand"] == true;
    for (name, property) in properties.iter().filter(|(name, p)| !is_set_elsewhere(name, p)) {
        let id = format!("{}.{name}", P::STAGE);
        let variants = variants_of(property, schema);
        if let Some((kind, optional)) = kind_of(property, schema) {
            let dashed = name.replace('_', "-");
            let flag = if clashes.contains(name) { format!("{}-{dashed}", P::STAGE) } else { dashed };
            let help = help_of(property, &defaults[name], &kind);
            let (variant, rivals) = (None, Vec::new());
            found.push(Field { name: name.clone(), variant, rivals, id, flag, help, kind, optional });
            continue;
        }
        for (variant, described, kind) in &variants {
            let others = variants.iter().filter(|v| v.0 != *variant);
            found.push(Field {
                name: name.clone(),
                variant: Some(variant.clone()),
                rivals: others.map(|v| format!("{id}.{}", v.0)).collect(),
                id: format!("{id}.{variant}"),
                flag: variant.replace('_', "-"),
                help: help_of(described, &defaults[name][variant], kind),
                kind: kind.clone(),
                optional: false,
            });
        }
    }
    found
}

/// The help of a property: its doc comment, its default, its unit.
fn help_of(property: &Value, default: &Value, kind: &Kind) -> String {
    let text = property["description"].as_str().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ");
    let mut help = text.trim_end_matches('.').to_owned();
    if let Kind::Tolerance(_) = kind {
        help += ": a length (0.05 in units of the input, 0.05mm) or a share of the diagonal (0.02%)";
    }
    match (default, kind) {
        (Value::Null, _) | (_, Kind::PerPatch) => {}
        (value, Kind::Tolerance(Of::Share)) => {
            help += &format!(" [default: {}%]", value.as_f64().unwrap_or(0.0) * 100.0);
        }
        (Value::String(word), _) => help += &format!(" [default: {word}]"),
        (value, _) => help += &format!(" [default: {value}]"),
    }
    if let Some(unit) = property["unit"].as_str() {
        help += &format!(" [unit: {unit}]");
    }
    help
}

/// The variants of an enum field whose variants carry one value each: name, description, kind.
fn variants_of(property: &Value, schema: &Value) -> Vec<(String, Value, Kind)> {
    // One that may be absent.
    let inner = property["anyOf"].as_array().and_then(|any| any.iter().find(|p| p["$ref"].is_string()));
    let property = inner.unwrap_or(property);
    let property = match property["$ref"].as_str().and_then(|r| r.rsplit('/').next()) {
        Some(name) => &schema["$defs"][name],
        None => property,
    };
    let mut variants = Vec::new();
    for one in property["oneOf"].as_array().into_iter().flatten() {
        let Some((name, content)) = one["properties"].as_object().and_then(|p| p.iter().next()) else { continue };
        if let Some((kind, _)) = kind_of(content, schema) {
            variants.push((name.clone(), one.clone(), kind));
        }
    }
    variants
}

/// The kind of a property and whether it may be absent; `None` for nested structs.
fn kind_of(property: &Value, schema: &Value) -> Option<(Kind, bool)> {
    if let Some(reference) = property["$ref"].as_str() {
        let name = reference.rsplit('/').next()?;
        return kind_of(&schema["$defs"][name], schema);
    }
    if let Some(any) = property["anyOf"].as_array() {
        let (kind, _) = any.iter().find_map(|p| kind_of(p, schema))?;
        return Some((kind, any.iter().any(|p| p["type"] == "null")));
    }
    if let Some(words) = choices(property) {
        return Some((Kind::Choice(words), false));
    }
    match property["tolerance"].as_str() {
        Some("share") => return Some((Kind::Tolerance(Of::Share), false)),
        Some("length") => return Some((Kind::Tolerance(Of::Length), false)),
        _ => {}
    }
    if property["per_patch"] == true {
        return Some((Kind::PerPatch, false));
    }
    let types: Vec<&str> = match &property["type"] {
        Value::String(t) => vec![t],
        Value::Array(many) => many.iter().filter_map(Value::as_str).collect(),
        _ => return None,
    };
    if types.contains(&"array") {
        if property["items"]["type"] != "integer" {
            return None;
        }
        let count = property["minItems"].as_u64().filter(|n| property["maxItems"].as_u64() == Some(*n));
        let (min, max) = (property["items"]["minimum"].as_f64(), property["items"]["maximum"].as_f64());
        return Some((Kind::Wholes { count: count.map(|n| n as usize), min, max }, false));
    }
    let nullable = types.contains(&"null");
    let (min, max) = (property["minimum"].as_f64(), property["maximum"].as_f64());
    let kind = match types.into_iter().find(|t| *t != "null")? {
        "boolean" => Kind::Flag,
        "integer" => Kind::Whole { min, max },
        "number" => Kind::Real { min, max, above: property["exclusiveMinimum"].as_f64() },
        _ => return None,
    };
    Some((kind, nullable))
}

/// The words of a plain enum.
fn choices(property: &Value) -> Option<Vec<String>> {
    let mut words = Vec::new();
    for word in property["enum"].as_array().into_iter().flatten() {
        words.push(word.as_str()?.to_owned());
    }
    for one in property["oneOf"].as_array().into_iter().flatten() {
        words.push(one["const"].as_str()?.to_owned());
    }
    (!words.is_empty()).then_some(words)
}

/// Field names that more than one stage has, or one stage and a group of options that many commands have.
fn clashing_names() -> Vec<String> {
    let stages = serde_json::to_value(PipelineParams::default()).unwrap_or_default();
    let fields = stages.as_object().into_iter().flat_map(|s| s.values()).filter_map(Value::as_object);
    let mut names: Vec<String> = fields.flat_map(|f| f.keys().cloned()).collect();
    names.sort();
    let mut clashes: Vec<String> = names.windows(2).filter(|w| w[0] == w[1]).map(|w| w[0].clone()).collect();
    let by_hand = ScanArgs::augment_args(HoleArgs::augment_args(Common::augment_args(Command::default())));
    clashes.extend(by_hand.get_arguments().filter_map(Arg::get_long).map(|long| long.replace('-', "_")));
    clashes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::Cli;
    use crate::check;
    use clap::{CommandFactory, Parser};
    use planish::cloud::{CleanParams, ProjectParams};
    use planish::contour::ContourParams;
    use planish::grid::GridParams;
    use planish::layout::LayoutParams;
    use planish::mend::MendParams;
    use planish::mesh::{DecimateParams, SmoothParams};
    use planish::pipeline::ScanParams;
    use planish::surface::{FitParams, StitchParams};
    use planish::synthetic::ScannerParams;
    use std::collections::BTreeSet;

    /// The commands that do something, with their words.
    fn leaves() -> Vec<(Vec<String>, Command)> {
        fn collect(command: &Command, words: Vec<String>, into: &mut Vec<(Vec<String>, Command)>) {
            let below: Vec<&Command> = command.get_subcommands().filter(|c| c.get_name() != "help").collect();
            if below.is_empty() {
                into.push((words.clone(), command.clone()));
            }
            for inner in below {
                collect(inner, [&words[..], &[inner.get_name().to_owned()]].concat(), into);
            }
        }
        let mut all = Vec::new();
        collect(&Cli::command(), Vec::new(), &mut all);
        all
    }

    /// clap itself looks for this in debug builds alone.
    #[test]
    fn no_command_has_two_options_of_one_name() {
        for (_, command) in leaves() {
            let (mut names, mut ids) = (BTreeSet::new(), BTreeSet::new());
            for arg in command.get_arguments() {
                let long = arg.get_long().map(|l| format!("--{l}"));
                for name in long.into_iter().chain(arg.get_short().map(|s| format!("-{s}"))) {
                    assert!(names.insert(name.clone()), "planish {} has two options {name}", command.get_name());
                }
                assert!(ids.insert(arg.get_id().clone()), "planish {}: two ids {}", command.get_name(), arg.get_id());
            }
            let tells = !["completions", "man"].contains(&command.get_name());
            assert_eq!(names.contains("--report"), tells, "{names:?}");
        }
    }

    #[test]
    fn every_command_has_examples_that_it_takes() {
        for (words, command) in leaves() {
            let told = command.get_after_help().map(|t| t.to_string()).unwrap_or_default();
            let lines: Vec<&str> = told.lines().filter(|l| l.trim_start().starts_with("planish ")).collect();
            assert!(!lines.is_empty(), "planish {} has no example", words.join(" "));
            // What shells make of it: quotes, pipes, places of files.
            for line in told.lines().skip(1).flat_map(|l| l.split(" | ")).filter(|l| l.trim().starts_with("planish ")) {
                let plain = line.split(['<', '>']).next().unwrap_or_default();
                let mut args = Vec::new();
                for (k, piece) in plain.split('\'').enumerate() {
                    match k % 2 {
                        0 => args.extend(piece.split_whitespace().map(str::to_owned)),
                        _ => args.push(piece.to_owned()),
                    }
                }
                let parsed = Cli::try_parse_from(&args).unwrap_or_else(|e| panic!("{line}: {e}"));
                check::check(&parsed.command).unwrap_or_else(|e| panic!("{line}: {e}"));
            }
        }
    }

    /// Fields of all stages.
    fn all_fields() -> Vec<Field> {
        let mut all = fields::<MendParams>();
        all.extend(fields::<LayoutParams>());
        all.extend(fields::<GridParams>());
        all.extend(fields::<FitParams>());
        all.extend(fields::<StitchParams>());
        all.extend(fields::<CleanParams>());
        all.extend(fields::<ProjectParams>());
        all.extend(fields::<ScanParams>());
        all.extend(fields::<ContourParams>());
        all.extend(fields::<planish::field::GridParams>());
        all.extend(fields::<SmoothParams>());
        all.extend(fields::<DecimateParams>());
        all.extend(fields::<ScannerParams>());
        all.extend(fields::<planish::relief::maps::MapParams>());
        all
    }

    /// Values just inside a range, and just outside.
    fn ends(kind: &Kind) -> (Vec<String>, Vec<String>) {
        let outside = |x: f64, way: f64| x + way * (x.abs() * 1e-3).max(1e-9);
        match kind {
            Kind::Whole { min, max } => {
                let inside = [min, max].into_iter().flatten().map(|x| format!("{x}")).collect();
                let outside = [min.map(|x| x - 1.0), max.map(|x| x + 1.0)].into_iter().flatten();
                (inside, outside.map(|x| format!("{x}")).collect())
            }
            Kind::Real { min, max, above } => {
                let inside = [min, max].into_iter().flatten().map(|x| format!("{x}")).collect();
                let low = min.map(|x| outside(x, -1.0)).or(*above);
                (inside, [low, max.map(|x| outside(x, 1.0))].into_iter().flatten().map(|x| format!("{x}")).collect())
            }
            Kind::Wholes { count, min, max } => {
                let list = |x: f64| vec![format!("{x}"); count.unwrap_or(3)].join(",");
                let inside = [min, max].into_iter().flatten().map(|&x| list(x)).collect();
                let mut outside: Vec<String> =
                    [min.map(|x| x - 1.0), max.map(|x| x + 1.0)].into_iter().flatten().map(list).collect();
                outside.extend(count.map(|c| vec!["5"; c + 1].join("x")));
                (inside, outside)
            }
            Kind::Tolerance(_) => {
                (vec!["0.05mm".into(), "0.02%".into(), "1e-9".into()], vec!["0".into(), "-1%".into(), "5ft".into()])
            }
            Kind::PerPatch => {
                let wrong = ["12x8", "12@3", "3x8@1", "12x8@-1", "12x8@1,", "8194x8@0"];
                (vec!["12x8@17".into(), "4x8193@0,5x5@1".into()], wrong.map(String::from).to_vec())
            }
            Kind::Flag | Kind::Choice(_) => (Vec::new(), vec!["perhaps".into()]),
        }
    }

    /// The command line with the least that each command needs.
    fn least(words: &[String]) -> Vec<&str> {
        let mut args = vec!["planish"];
        args.extend(words.iter().map(String::as_str));
        args.extend(match words.last().map_or("", String::as_str) {
            "import" => &["a.planish", "maps", "-o", "b.planish"][..],
            "part" => &["a.planish", "-o", "b.planish", "--wavelength", "5mm"],
            "deform" => &["a.planish", "s.obj", "-o", "b.planish"],
            "edit" if words.len() > 1 => &["a.planish", "b.toml", "-o", "c.planish"],
            "demo" | "man" => &[],
            "completions" => &["bash"],
            "info" => &["a.ply"],
            "compare" => &["a.ply", "b.ply"],
            "edit" => &["a.planish", "b.toml"],
            _ => &["a.ply", "-o", "b"],
        });
        args
    }

    #[test]
    fn no_option_of_any_command_takes_a_value_out_of_its_range_or_of_no_sense() {
        let known = all_fields();
        let mut tried = 0;
        for (words, command) in leaves() {
            let parse = |arg: &Arg, value: &str| {
                let option = format!("--{}={value}", arg.get_long().unwrap_or_default());
                let mut args = least(&words);
                if arg.get_long() == Some("wavelength") {
                    args.truncate(args.len() - 2);
                }
                args.push(&option);
                Cli::try_parse_from(args).map_err(|e| e.to_string())
            };
            for arg in command.get_arguments().filter(|a| a.get_long().is_some() && a.get_action().takes_values()) {
                let field = known.iter().find(|f| arg.get_id() == f.id.as_str());
                let name = arg.get_value_names().and_then(|n| n.first()).map_or("", |n| n.as_str());
                let (inside, mut wrong) = field.map_or_else(Default::default, |f| ends(&f.kind));
                let checked = ["N", "GB", "LENGTH|%", "%", "AXIS", "WORD", "UNITS", "PAIRS", "IP"];
                let is_number = checked.contains(&name);
                let is_step = name.contains(',') || name == "z-to-y|y-to-z";
                if field.is_none() && !is_number && !is_step {
                    assert!(
                        ["DIR", "FILE", "FORMAT", "NAMES", "TOKEN", ".json", ".planish", ".toml"]
                            .iter()
                            .any(|n| name.contains(n)),
                        "{name}"
                    );
                    continue;
                }
                wrong.extend(
                    ["nan", "inf", "-inf", "1e999", "0x10", "1_000", "five", "3,5 mm", "1;2", " "].map(String::from),
                );
                if name != "LENGTH|%" {
                    wrong.push("5mm".into());
                }
                for value in inside {
                    parse(arg, &value).unwrap_or_else(|e| panic!("{} --{}={value}: {e}", command.get_name(), name));
                }
                for value in wrong {
                    let told = parse(arg, &value).and_then(|cli| check::check(&cli.command).map_err(|e| e.to_string()));
                    let told = told.expect_err(&format!("planish {} {}={value}", command.get_name(), arg.get_id()));
                    assert!(told.starts_with("error: "), "{told}");
                    tried += 1;
                }
            }
        }
        assert!(tried > 1000, "{tried}");
    }
}
