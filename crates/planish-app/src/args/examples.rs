//! Examples at the end of each command's help. A test parses all of them.

pub const DEMO: &str = "\
Examples:
  planish demo
  planish demo -o look --points 20000 --noise 0.001";

pub const RUN: &str = "\
Examples:
  planish run part.ply -o part --units mm
  planish run scan.e57 -o part --tolerance 0.02%
  planish run 'scans/*.e57' extra.ply -o out --jobs 2 --patches 60
  zcat part.stl.gz | planish run - --from stl -o part";

pub const CLEAN: &str = "\
Examples:
  planish clean scan.e57 -o points.ply
  planish clean survey.laz -o ground.laz --classes 2 --segment
  planish clean - --from xyz --columns xyzirgb -o - --to ply < scan.txt | planish mesh - -o part.ply";

pub const MESH: &str = "\
Examples:
  planish mesh scan.e57 -o part.ply
  planish mesh broken.stl -o whole.ply --voxel 0.5
  planish mesh bracket.toml -o bracket.glb --resolution 200
  planish mesh head.nrrd -o head.ply --iso 500 --body above
  planish mesh 'max(x^2 + y^2 - 1, abs(z) - 2)' --formula --bounds=-3,3 -o can.stl
  planish mesh part.stl -o part.nrrd --resolution 100";

pub const SMOOTH: &str = "\
Examples:
  planish smooth part.ply -o even.ply
  planish smooth part.stl -o even.stl --noise 0.05";

pub const DECIMATE: &str = "\
Examples:
  planish decimate part.ply -o less.ply --ratio 0.2
  planish decimate part.ply -o less.ply --tolerance 0.01mm";

pub const LAYOUT: &str = "\
Examples:
  planish layout part.ply -o network.json
  planish layout part.ply -o network.json --patches 40 --sharp-angle-deg 25";

pub const FIT: &str = "\
Examples:
  planish fit part.ply --network network.json -o part.planish
  planish fit part.planish --control 12x12 -o finer.planish";

pub const EDIT: &str = "\
Examples:
  planish edit part.planish moves.toml -o edited.planish
  planish edit part.ply curves.toml -o drawn.planish --pictures steps";

pub const DEFORM: &str = "\
Examples:
  planish deform part.planish moved.obj -o bent.planish";

pub const RELIEF_EXPORT: &str = "\
Examples:
  planish relief export part.planish -o maps";

pub const RELIEF_IMPORT: &str = "\
Examples:
  planish relief import part.planish maps -o painted.planish";

pub const RELIEF_EDIT: &str = "\
Examples:
  planish relief edit part.planish strokes.toml -o carved.planish";

pub const RELIEF_PART: &str = "\
Examples:
  planish relief part part.planish -o parted.planish --wavelength 5mm";

pub const RELIEF_LEVEL: &str = "\
Examples:
  planish relief level part.planish -o coarse.planish --control 8x8";

pub const RELIEF_TRANSFER: &str = "\
Examples:
  planish relief transfer plain.planish detailed.planish -o both.planish
  planish relief transfer bust.planish head.planish --points eyes.toml -o both.planish
  planish relief transfer part.planish --pairs 0:3,0:4 -o copied.planish";

pub const EXPORT: &str = "\
Examples:
  planish export part.planish -o part.step
  planish export part.planish -o part.glb --up z
  planish export part.planish --surface base -o - --to ply | planish info -";

pub const COMPARE: &str = "\
Examples:
  planish compare scan.e57 part.planish --tolerance 0.05mm
  planish compare part.ply old.stl --align --picture away.png -o coloured.ply";

pub const TRANSFORM: &str = "\
Examples:
  planish transform part.stl -o turned.stl --turn x,90
  planish transform a.ply -o fitted.ply --align b.ply";

pub const INFO: &str = "\
Examples:
  planish info part.ply
  planish info out/*.planish --json";

pub const STUDIO: &str = "\
Examples:
  planish studio part.planish
  planish studio scan.e57 --no-open --port 8080";

pub const COMPLETIONS: &str = "\
Examples:
  planish completions bash > ~/.local/share/bash-completion/completions/planish
  planish completions zsh > ~/.zfunc/_planish";

pub const MAN: &str = "\
Examples:
  planish man run | man -l -
  planish man -o ~/.local/share/man/man1";
