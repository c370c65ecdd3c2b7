"""Relief moved to another model: the bumps of a ball on other patches of its smooth form.

python move_relief.py [OUTPUT.planish]
"""

import sys

import numpy as np

import planish


def main(output: str = "moved.planish", *, level: int = 4) -> planish.Model:
    ball = planish.sphere(10.0, level)
    unit = ball.points / 10.0
    height = 0.05 * np.sin(25.0 * unit[:, 0]) * np.sin(22.0 * unit[:, 1])
    bumpy = planish.Mesh(ball.points + height[:, None] * unit, ball.triangles)

    # On few control points the bumps are left to the displacement maps; the smooth form gets patches of its own.
    detailed = bumpy.fit(patches=6, control=[6, 6])
    plain = detailed.surface_mesh("base").fit(patches=24, tolerance=2e-4)

    moved = plain.transfer_relief(detailed)
    wanted = detailed.surface_mesh("displaced")
    for name, model in (("before", plain), ("after", moved)):
        away = model.surface_mesh("displaced").compare(wanted)["both"]
        print(f"{name}: {away['rms']:.4f} RMS, {away['max']:.4f} at most from the bumpy ball")
    longest = max(np.linalg.norm(relief.vectors, axis=2).max() for relief in moved.reliefs)
    print(f"{moved.facts['texels']} texels, {moved.facts['missed']} of them too far away, the longest {longest:.4f}")

    moved.save(output)
    return moved


if __name__ == "__main__":
    main(*sys.argv[1:2])
