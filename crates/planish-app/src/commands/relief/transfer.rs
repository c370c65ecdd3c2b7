//! `planish relief transfer`: detail from another model, or from other patches, as a layer.

use super::super::Session;
use super::{displaced, finish, open, points, wrong};
use crate::args::relief::{Pair, ReliefTransfer};
use crate::failure::{Failure, Status};
use crate::files;
use crate::progress::Interrupt;
use crate::tolerance::Scale;
use planish::model::{HistoryEntry, Model};
use planish::pipeline::Warning;
use planish::relief::Relief;
use planish::relief::layers::{self, Ground};
use planish_io::report::{Report, count, number};

/// How far detail is looked for unless the user says, share of the diagonal: shapes are equal.
const REACH: f64 = 0.02;
/// The same with pairs of places: between the pairs, shapes are as far apart as models of one kind are.
const REACH_OF_POINTS: f64 = 0.1;

pub fn transfer(session: &Session, args: &ReliefTransfer) -> Result<Status, Failure> {
    files::check_extension(&args.output, &["planish"])?;
    if args.pairs.is_empty() && args.from.is_none() {
        let what = "needs FROM.planish, the model that has the detail";
        return Err(Failure::usage("relief transfer", what).hint("name it, or name patches with --pairs"));
    }
    if args.points.is_some() && args.from.is_none() {
        let what = "needs FROM.planish, the model whose places stand first";
        return Err(Failure::usage("--points", what).hint("name it after the model"));
    }
    let (mut model, read) = open(session, &args.model)?;
    let from = args.from.as_ref().map(|path| open(session, path)).transpose()?.map(|(model, _)| model);
    let mut report = Report::new("relief transfer", files::model_facts(&args.model, &model, model.units));
    let warnings = &mut report.warnings;
    let ((maps, told), record) = session.step("transfer", || carried(&model, from.as_ref(), args, warnings))?;
    model.layers.begin(&model.reliefs);
    let stack = model.layers.with("transfer", maps);
    let pairs: Vec<[u32; 3]> = args.pairs.iter().map(|p| [p.from, p.to, p.turns]).collect();
    let parameters = serde_json::json!({ "from": args.from, "pairs": pairs, "points": args.points }).to_string();
    model.record_relief(HistoryEntry { command: "relief transfer".into(), parameters }, stack);
    report.stages = vec![read, record];
    let heads = std::iter::once("transferred").chain(std::iter::repeat(""));
    let told = heads.zip(told).map(|(head, line)| (head.to_owned(), line)).collect();
    finish(session, &args.output, &model, report, told)
}

fn carried(
    model: &Model,
    from: Option<&Model>,
    args: &ReliefTransfer,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Relief>, Vec<String>), Failure> {
    let failed = |e| wrong(&args.model, e);
    let shapes: Vec<[usize; 2]> = model.reliefs.iter().map(|r| [r.rows, r.cols]).collect();
    let ground = Ground::new(&model.network, &model.surfaces, shapes).map_err(failed)?;
    let source = from.unwrap_or(model);
    if args.pairs.is_empty() {
        let mut told = Vec::new();
        let warp = match &args.points {
            None => None,
            Some(path) => {
                let pairs = points::read(path, [source.shift, model.shift])?;
                let warp = layers::warp(&ground, &displaced(source), &pairs, &Interrupt).map_err(|e| wrong(path, e))?;
                let kind = if warp.affine { "an affine map" } else { "a similarity" };
                let bent = number(warp.bent);
                told.push(format!("{} pairs; {kind} leaves {bent} {}, the rest bends", pairs.len(), model.units));
                Some(warp)
            }
        };
        let scale = Scale { diagonal: model.mesh.bounds().diagonal(), units: model.units };
        let default = if warp.is_some() { REACH_OF_POINTS } else { REACH };
        let reach = args.reach.map_or(default * scale.diagonal, |reach| reach.length(scale));
        let (maps, missed) =
            layers::transfer(&ground, &displaced(source), warp.as_ref(), reach, &Interrupt).map_err(failed)?;
        let texels: usize = maps.iter().map(|m| m.vectors.len()).sum();
        if missed == texels {
            let text = "No texel got anything: there is no detail within reach. A larger --reach looks further.";
            warnings.push(Warning::new("nothing_transferred", text, ""));
        }
        let found = count((texels - missed) as u64);
        told.push(format!("{found} texels, {} too far away", count(missed as u64)));
        return Ok((maps, told));
    }
    let mut maps: Vec<Relief> = model.reliefs.iter().map(|r| Relief { vectors: Vec::new(), ..*r }).collect();
    for &Pair { from: a, to: b, turns } in &args.pairs {
        for (patch, count) in [(a, source.reliefs.len()), (b, model.reliefs.len())] {
            if patch as usize >= count {
                return Err(Failure::usage("--pairs", format!("there is no patch {patch} among {count}"))
                    .hint("see `planish info`"));
            }
        }
        let one = layers::paste(&ground, &source.reliefs[a as usize], &[(turns, b)]);
        for (sum, more) in maps.iter_mut().zip(one) {
            match (sum.vectors.is_empty(), more.vectors.is_empty()) {
                (_, true) => {}
                (true, false) => sum.vectors = more.vectors,
                _ => sum.vectors.iter_mut().zip(more.vectors).for_each(|(a, b)| *a += b),
            }
        }
    }
    Ok((maps, vec![format!("{} pairs of patches", args.pairs.len())]))
}
