#!/usr/bin/env python3
"""Makes a head with a snout and two ears, as a volume of distances: `head.py OUT.nrrd`.

    python3 examples/edit/head.py head.nrrd
    planish mesh head.nrrd --plain -o head.ply
    planish edit head.ply examples/edit/head.toml -o head.planish --pictures out/head

Rounded solids are blended into one another: the blend is -K log(sum of exp(-d / K)). Right and left are mirror images
across x = 0. Takes a few seconds and no other packages.
"""

import array
import math
import sys

K = 0.07
# Each sample is this far from the next, and x of the middle ones is zero.
STEP = 0.05
LOW = (-0.9, -1.55, -1.6)
COUNT = (37, 58, 64)

# Ends, radius at each end. Those with an x are on both sides.
LIMBS = [
    ((0.0, 0.05, -0.10), (0.0, 0.0, 0.15), 0.66, 0.60),  # skull
    ((0.0, -0.18, 0.45), (0.0, -0.33, 1.25), 0.40, 0.21),  # snout
    ((0.0, -0.20, 1.33), (0.0, -0.20, 1.33), 0.11, 0.11),  # nose
    ((0.0, -0.45, 0.30), (0.0, -0.52, 1.00), 0.28, 0.14),  # lower jaw
    ((0.38, -0.22, 0.25), (0.30, -0.28, 0.50), 0.32, 0.22),  # cheeks
    ((0.22, 0.28, 0.42), (0.36, 0.20, 0.30), 0.17, 0.17),  # brows
    ((0.36, 0.42, -0.20), (0.58, 1.12, -0.28), 0.24, 0.07),  # ears
    ((0.0, -0.25, -0.45), (0.0, -0.90, -0.95), 0.56, 0.50),  # neck
]


def distance(p, a, b, r, s):
    """Distance from the segment a b, less a radius that goes from r to s."""
    d = [b[i] - a[i] for i in range(3)]
    e = [p[i] - a[i] for i in range(3)]
    square = sum(x * x for x in d)
    t = max(0.0, min(1.0, sum(x * y for x, y in zip(d, e)) / square)) if square > 0.0 else 0.0
    return math.sqrt(sum((e[i] - t * d[i]) ** 2 for i in range(3))) - (r + t * (s - r))


def blend(p):
    total = sum(math.exp(-distance(p, *limb) / K) for limb in LIMBS)
    return -K * math.log(total)


def main(out):
    values = array.array("f")
    middle = COUNT[0] // 2
    for k in range(COUNT[2]):
        for j in range(COUNT[1]):
            y, z = LOW[1] + j * STEP, LOW[2] + k * STEP
            right = [blend((i * STEP, y, z)) for i in range(middle + 1)]
            values.extend(right[:0:-1])
            values.extend(right)
    header = [
        "NRRD0004",
        "type: float",
        "dimension: 3",
        "sizes: %d %d %d" % COUNT,
        "spacings: %g %g %g" % (STEP, STEP, STEP),
        "axis mins: %g %g %g" % LOW,
        "endian: %s" % sys.byteorder,
        "encoding: raw",
    ]
    with open(out, "wb") as file:
        file.write(("\n".join(header) + "\n\n").encode() + values.tobytes())
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1]))
