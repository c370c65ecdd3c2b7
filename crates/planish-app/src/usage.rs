//! Wrong usage of the command line in one line, as every other error: `error: what is wrong - hint: what to do`.

use crate::args::Cli;
use crate::words;
use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::io::Write;

/// Tells what the parser of the command line says: help and version as they are, anything wrong in a line on stderr.
pub fn tell(error: &clap::Error) {
    if !error.use_stderr() || error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        // A closed pipe behind `planish --help | head` is no fault of the user.
        let _ = error.print();
        return;
    }
    let command = std::env::args().nth(1).unwrap_or_default();
    let _ = writeln!(std::io::stderr(), "{}", line(error, &command));
}

/// The line, for what was given as a command.
fn line(error: &clap::Error, command: &str) -> String {
    let text = error.render().to_string();
    // What is wrong ends with an empty line; tips, usage and where the help is follow.
    let (what, _) = text.split_once("\n\n").unwrap_or((&text, ""));
    let (what, choices) = what.split_once("[possible values:").unwrap_or((what, ""));
    let what = what.trim().trim_start_matches("error: ");
    let tips = [ContextKind::SuggestedArg, ContextKind::SuggestedSubcommand, ContextKind::SuggestedValue];
    let tip = tips.into_iter().find_map(|kind| match error.get(kind)? {
        ContextValue::String(word) => Some(word.clone()),
        ContextValue::Strings(words) => words.first().cloned(),
        _ => None,
    });
    let is_known = Cli::command().find_subcommand(command).is_some();
    let hint = match tip {
        Some(word) => format!("did you mean {word}?"),
        None if !choices.is_empty() => format!("use one of {}", choices.trim().trim_end_matches(']')),
        None if is_known => format!("see `planish {command} --help`"),
        None => "see `planish --help`".into(),
    };
    let what = shortened(what).split_whitespace().collect::<Vec<_>>().join(" ");
    format!("error: {} - hint: {hint}", words::plain(&what))
}

/// What the user wrote stands between single quotes: at most 60 letters of it.
fn shortened(what: &str) -> String {
    match (what.find('\''), what.find("' ")) {
        (Some(open), Some(close)) if open < close => {
            format!("{}'{}{}", &what[..open], words::quoted(&what[open + 1..close]), &what[close..])
        }
        _ => what.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[test]
    fn what_the_parser_says_is_one_line_with_a_way_out() {
        let long = "9".repeat(300);
        for (args, expected) in [
            ("", "run requires a subcommand"),
            ("polish", "error: unrecognized subcommand 'polish' - hint: see `planish --help`"),
            ("rum a.ply", "error: unrecognized subcommand 'rum' - hint: did you mean run?"),
            ("run a.ply", "required arguments were not provided: --output <DIR> - hint: see `planish run --help`"),
            ("run a.ply -o out --patchs 7", "- hint: did you mean --patches?"),
            ("run a.ply -o out --units furlong", "- hint: use one of mm, cm, m, in"),
            (
                "run a.ply -o out --density many",
                "invalid value 'many' for '--density': a number from 0.01 to 100 is needed - hint: see `planish run --help`",
            ),
            (&format!("run a.ply -o out --density {long}"), "99999...' for '--density'"),
        ] {
            let error = Cli::try_parse_from(["planish"].into_iter().chain(args.split_whitespace())).unwrap_err();
            if args.is_empty() {
                assert_eq!(error.kind(), ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand);
                continue;
            }
            let told = line(&error, args.split(' ').next().unwrap_or_default());
            assert!(told.contains(expected) && !told.contains('\n') && told.starts_with("error: "), "{args}: {told}");
            assert!(told.len() < 400 && told.contains(" - hint: "), "{args}: {told}");
        }
    }
}
