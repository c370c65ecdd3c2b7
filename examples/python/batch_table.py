"""Twenty parts in a batch, with a table: python batch_table.py [FOLDER]

Run it twice: what is finished is skipped.
"""

import sys
from pathlib import Path

import planish


def main(folder: str = "batch", *, parts: int = 20, jobs: int = 2) -> planish.Batch:
    inputs = Path(folder) / "parts"
    inputs.mkdir(parents=True, exist_ok=True)
    sources = []
    for k in range(parts):
        path = inputs / f"box-{k:02}.stl"
        if not path.exists():
            planish.cuboid((40.0 + k, 30.0, 20.0), cells=6).write(path)
        sources.append(path)
    table = planish.run_many(sources, folder, jobs=jobs, patches=6, units="mm")
    print(table)
    return table


if __name__ == "__main__":
    main(*sys.argv[1:2])
