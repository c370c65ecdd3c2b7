#!/usr/bin/env python3
"""Takes the pictures out of a report for the guide: `pictures.py REPORT.html FOLDER`.

Each becomes FOLDER/<title>.png, the title in small letters with dashes. `pictures.py PICTURE.png FOLDER` makes one of a program
smaller, with Pillow: 800 pixels wide, in at most 128 colours.
"""

import base64
import pathlib
import re
import sys


WIDTH = 800
COLORS = 128


def smaller(picture: pathlib.Path, folder: pathlib.Path) -> int:
    from PIL import Image

    with Image.open(picture) as image:
        size = (WIDTH, round(image.height * WIDTH / image.width))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS).quantize(COLORS, dither=Image.Dither.NONE)
    folder.mkdir(parents=True, exist_ok=True)
    small.save(folder / picture.name, optimize=True)
    print(folder / picture.name)
    return 0


def main(report: str, folder: str) -> int:
    if report.endswith(".png"):
        return smaller(pathlib.Path(report), pathlib.Path(folder))
    page = pathlib.Path(report).read_text(encoding="utf-8")
    found = re.findall(r'<img alt="([^"]+)" src="data:image/png;base64,([^"]+)"', page)
    if not found:
        print(f"error: {report}: has no pictures - hint: give the report.html of `planish run`", file=sys.stderr)
        return 3
    target = pathlib.Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for title, data in found:
        name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") + ".png"
        (target / name).write_bytes(base64.b64decode(data))
        print(target / name)
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    sys.exit(main(sys.argv[1], sys.argv[2]))
