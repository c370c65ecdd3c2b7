#!/usr/bin/env bash
# The whole way in steps, on a synthetic part: `examples/step_by_step.sh FOLDER`.
set -euo pipefail
out=${1:?give a folder}
planish=${PLANISH:-target/release/planish}

"$planish" demo -o "$out" --triangles 20000
"$planish" info "$out/demo.ply"
"$planish" layout "$out/demo.ply" -o "$out/network.json" --patches 60
"$planish" fit "$out/demo.ply" --network "$out/network.json" -o "$out/part.planish"
"$planish" export "$out/part.planish" -o "$out/part.step"
"$planish" export "$out/part.planish" -o "$out/maps"
"$planish" compare "$out/demo.ply" "$out/part.planish"
