#!/usr/bin/env bash
# The whole way in steps, on the mesh of a synthetic scan: `examples/step_by_step.sh FOLDER [POINTS]`.
set -euo pipefail
out=${1:?give a folder}
points=${2:-20000}
planish=${PLANISH:-target/release/planish}

"$planish" demo -o "$out" --points "$points"
"$planish" info "$out/mesh.ply"
"$planish" layout "$out/mesh.ply" -o "$out/network.json" --patches 60
"$planish" fit "$out/mesh.ply" --network "$out/network.json" -o "$out/part.planish"
"$planish" export "$out/part.planish" -o "$out/part.step"
"$planish" export "$out/part.planish" -o "$out/maps"
"$planish" compare "$out/mesh.ply" "$out/part.planish"
