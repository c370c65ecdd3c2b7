//! Steps of `planish transform`: options that are done one after the other, in the order in which they are written.

use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use planish::DVec3;
use planish::register::HalfSpace;
use std::path::PathBuf;

/// One step.
#[derive(Clone, Debug, PartialEq)]
pub enum Step {
    /// Moves by a vector.
    Move(DVec3),
    /// Turns around an axis by degrees.
    Turn(DVec3, f64),
    /// Scales along the axes.
    Scale(DVec3),
    /// Mirrors along an axis.
    Mirror(DVec3),
    /// Sets the place that turns, scales and mirrors after it leave where it is; none for the middle of the box.
    About(Option<DVec3>),
    /// Turns y up into z up, or back.
    Up(bool),
    /// Keeps what lies on one side of each plane.
    Crop(Vec<HalfSpace>),
    /// Fits on another shape.
    Align(PathBuf),
    /// Brings points onto others, from a file of six numbers in each line.
    Pairs(PathBuf),
}

/// The steps in the order of the command line.
#[derive(Clone, Debug, Default)]
pub struct Steps(pub Vec<Step>);

/// Name, what its value is called, help.
const OPTIONS: [(&str, &str, &str); 10] = [
    ("move", "X,Y,Z", "Move by a vector, units of the input"),
    (
        "turn",
        "AXIS,DEGREES",
        "Turn around an axis through --about, counter-clockwise seen from its tip: z,90 or 1,1,0,30",
    ),
    ("scale", "S|X,Y,Z", "Scale from --about, evenly or along each axis"),
    (
        "mirror",
        "AXIS",
        "Mirror at the plane through --about that is normal to an axis: x, y, z or a vector; outside stays outside",
    ),
    ("about", "X,Y,Z|center", "What the turns, scales and mirrors after it leave where it is [default: 0,0,0]"),
    ("up", "z-to-y|y-to-z", "Turn what points up: by 90 degrees around the first axis"),
    ("crop-box", "X,Y,Z,X,Y,Z", "Keep what lies in the box between two corners; triangles are cut"),
    ("crop-plane", "X,Y,Z,D", "Keep the places with x X + y Y + z Z >= D; triangles are cut"),
    ("align", "FILE", "Bring it onto a scan, a mesh or a model: the best rigid fit"),
    ("pairs", "FILE.csv", "Bring points onto others: a line each with x, y, z now and x, y, z then; three at least"),
];

impl Args for Steps {
    fn augment_args(command: Command) -> Command {
        let option = |(name, value, help): (&'static str, &'static str, &'static str)| {
            Arg::new(name)
                .long(name)
                .value_name(value)
                .help(help)
                .action(ArgAction::Append)
                .allow_hyphen_values(true)
                .help_heading("Steps: done one after the other, as they are written")
                .value_parser(move |text: &str| step(name, text).map(|_| text.to_owned()))
        };
        command.args(OPTIONS.map(option))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Steps::augment_args(command)
    }
}

impl FromArgMatches for Steps {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Steps, clap::Error> {
        let mut found: Vec<(usize, Step)> = Vec::new();
        for (name, ..) in OPTIONS {
            let texts = matches.get_many::<String>(name).into_iter().flatten();
            for (at, text) in matches.indices_of(name).into_iter().flatten().zip(texts) {
                let step =
                    step(name, text).map_err(|e| clap::Error::raw(clap::error::ErrorKind::ValueValidation, e))?;
                found.push((at, step));
            }
        }
        found.sort_by_key(|f| f.0);
        Ok(Steps(found.into_iter().map(|f| f.1).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Steps::from_arg_matches(matches)?;
        Ok(())
    }
}

/// What is asked of the value of an option that is none.
fn wanted(name: &str) -> String {
    match name {
        "turn" => "an axis and degrees are needed, such as z,90 or 1,1,0,30".into(),
        "scale" => "a number above 0 is needed, or three".into(),
        "mirror" => "x, y, z or a vector is needed".into(),
        "about" => "three numbers are needed, or center".into(),
        "up" => "z-to-y or y-to-z is needed".into(),
        "crop-box" => "two corners are needed, six numbers, the lesser corner first".into(),
        "crop-plane" => "a normal and a distance are needed, four numbers".into(),
        "move" => "three numbers are needed".into(),
        _ => "a file is needed".into(),
    }
}

fn step(name: &str, text: &str) -> Result<Step, String> {
    let found = match name {
        "move" => vector(text).map(Step::Move),
        "turn" => text.rsplit_once(',').and_then(|(a, d)| Some(Step::Turn(axis(a)?, numbers(d, 1)?[0]))),
        "scale" => numbers(text, 1)
            .map(|s| DVec3::splat(s[0]))
            .or_else(|| vector(text))
            .filter(|s| s.min_element() > 0.0)
            .map(Step::Scale),
        "mirror" => axis(text).map(Step::Mirror),
        "about" if text == "center" => Some(Step::About(None)),
        "about" => vector(text).map(|p| Step::About(Some(p))),
        "up" => match text {
            "z-to-y" => Some(Step::Up(true)),
            "y-to-z" => Some(Step::Up(false)),
            _ => None,
        },
        "crop-box" => numbers(text, 6)
            .map(|n| (DVec3::from_slice(&n), DVec3::from_slice(&n[3..])))
            .filter(|(min, max)| min.cmplt(*max).all())
            .map(|(min, max)| Step::Crop(HalfSpace::of_box(min, max).into())),
        "crop-plane" => numbers(text, 4)
            .map(|n| HalfSpace { normal: DVec3::from_slice(&n), offset: n[3] })
            .filter(|side| side.normal != DVec3::ZERO)
            .map(|side| Step::Crop(vec![side])),
        "align" if !text.is_empty() => Some(Step::Align(text.into())),
        "pairs" if !text.is_empty() => Some(Step::Pairs(text.into())),
        _ => None,
    };
    found.ok_or_else(|| wanted(name))
}

/// So many finite numbers with commas between them.
fn numbers(text: &str, count: usize) -> Option<Vec<f64>> {
    let all: Option<Vec<f64>> =
        text.split(',').map(|word| word.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    all.filter(|all| all.len() == count)
}

fn vector(text: &str) -> Option<DVec3> {
    numbers(text, 3).map(|n| DVec3::from_slice(&n))
}

/// A unit vector: an axis by its letter, or three numbers.
fn axis(text: &str) -> Option<DVec3> {
    match text.trim() {
        "x" => Some(DVec3::X),
        "y" => Some(DVec3::Y),
        "z" => Some(DVec3::Z),
        other => vector(other)?.try_normalize(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_and_what_is_none_is_told() {
        assert_eq!(step("move", "1,-2,3e1"), Ok(Step::Move(DVec3::new(1.0, -2.0, 30.0))));
        assert_eq!(step("turn", "z,-90"), Ok(Step::Turn(DVec3::Z, -90.0)));
        assert_eq!(step("turn", "0,0,2,45"), Ok(Step::Turn(DVec3::Z, 45.0)));
        assert_eq!(step("scale", "25.4"), Ok(Step::Scale(DVec3::splat(25.4))));
        assert_eq!(step("about", "center"), Ok(Step::About(None)));
        for (name, text) in [
            ("move", "1,2"),
            ("move", "1,2,nan"),
            ("turn", "90"),
            ("turn", "0,0,0,90"),
            ("scale", "0"),
            ("scale", "-1"),
            ("mirror", "w"),
            ("up", "z"),
            ("crop-box", "0,0,0,1,1,0"),
            ("crop-plane", "0,0,0,1"),
            ("align", ""),
        ] {
            assert_eq!(step(name, text), Err(wanted(name)), "{name} {text}");
        }
    }
}
