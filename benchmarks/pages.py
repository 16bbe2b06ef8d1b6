"""The index of a batch with 100,000 vehicles of 10,000 videos: `python -m benchmarks.pages`.

Times are those to make it, and in Chromium from the start of the navigation: to the first rows,
laid out, and to the end of the page.
"""

import json
import re
import subprocess
import tempfile
import time
from collections.abc import Mapping
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

from vdet.pages.render import jpeg_uri
from vdet.pages.video import write_index

CLASSES = ("car", "car", "car", "truck", "bus", "motorcycle")
FILTERS = {"class": "2", "video": "clip012", "seconds-min": "5", "from": "2026-05-04T10:00"}
STILL = np.full((112, 200, 3), 90, np.uint8)
UPDATE = "\nupdate();"
FIRST = f"{UPDATE}\ndocument.body.offsetHeight;\nconst firstRows = performance.now();\n"
MEASURES = f"""<script>
const taken = {{ "first rows": firstRows, "whole page": performance.now() }};
for (const [name, value] of Object.entries({json.dumps(FILTERS)})) {{
  form.elements[name].value = value;
  const begin = performance.now();
  form.dispatchEvent(new Event("input"));
  taken[name] = performance.now() - begin;
}}
document.title = JSON.stringify(taken);
</script></body>"""


def index_page(path: Path, videos: int = 10_000, each: int = 10) -> None:
    """Write the page of a batch."""
    rng = np.random.default_rng(1)
    still, written = jpeg_uri(STILL), dict[str, dict[str, object]]()
    for number in range(videos):
        rows = [
            {
                "id": n + 1,
                "class_name": CLASSES[rng.integers(len(CLASSES))],
                "first": round(float(600 * rng.random()), 3),
                "seconds": round(float(20 * rng.random()), 1),
                "clock": f"2026-05-{number % 28 + 1:02}T{number % 24:02}:30:07+02:00",
                "speed": round(float(90 * rng.random()), 1),
                "lines": ("", "north → south", "south → north")[rng.integers(3)],
                **dict.fromkeys(("distance", "lane")),
                **dict.fromkeys(("motion", "side", "size", "certainty", "picture", "clip"), ""),
            }
            for n in range(each)
        ]
        written[f"day{number // 100}/clip{number:05}"] = {
            "page": f"clip{number:05}.page/page.html",
            "plays": True,
            "start": 0.0,
            "seconds": 600,
            "frames": 15000,
            "vehicles": each,
            "max_at_once": 3,
            "still": still,
            "counts": {},
            "conditions": [],
            "rows": rows,
            "review": "",
        }
    write_index(written, path)


def in_chromium(page: Path, changes: Mapping[str, str]) -> Any:
    """Return what scripts in a page, put in place of some of its texts, write as its title."""
    copy, html = page.with_name("acts.html"), page.read_text("utf-8")
    for old, new in changes.items():
        assert html.count(old) == 1
        html = html.replace(old, new)
    copy.write_text(html, "utf-8")
    options = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={page.parent}")
    command = ["chromium", *options, "--window-size=1440,1000", "--dump-dom", copy.as_uri()]
    html = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    title, *_ = re.findall("<title>(.*?)</title>", html)
    return json.loads(unescape(title))


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        page, begin = Path(name) / "index.html", time.perf_counter()
        index_page(page)
        print(f"index of 100,000 vehicles: {time.perf_counter() - begin:.2f} s to make")
        for what, taken in in_chromium(page, {UPDATE: FIRST, "</body>": MEASURES}).items():
            print(f"  {what}: {taken:.0f} ms")


if __name__ == "__main__":
    main()
