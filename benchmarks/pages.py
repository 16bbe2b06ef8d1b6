"""How fast large pages are in Chromium: the index of a batch, and the page of a review.

    python -m benchmarks.pages          # both
    python -m benchmarks.pages index

The index has 100,000 vehicles of 10,000 videos. Times are those to make it, and from the start of
the navigation to the first rows, laid out, and to the end of the page.

The review is an hour of a drawn road seen from a pole, with four lanes and 600 vehicles at one
line. Of the tracks 5 % are missing, 5 % have the wrong class, and as many show no vehicle. A script
in the page checks all minutes as a person would who sees each error: it clicks on marks and on the
strip, and presses keys. Then the corrections are applied, and must give the true counts.
"""

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.corrections import by_class
from benchmarks.pole_cameras import MIN_WIDTH
from vdet.boxes import NO_BOXES
from vdet.config.schema import Settings
from vdet.files import OutputFiles
from vdet.findings import Findings
from vdet.media import Frame, Picture, VideoInfo
from vdet.pages.render import REVIEW_NAME, jpeg_uri
from vdet.pages.video import write_index
from vdet.review.corrections import Corrections, apply_corrections
from vdet.review.strips import BandPassage, Passages, bands_of
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, open_sinks
from vdet.run.steps import FrameResult
from vdet.synthetic import (
    LANE_WIDTH,
    LORRY,
    PinholeCamera,
    Renderer,
    Scene,
    SceneVehicle,
    TrueBox,
    Waypoint,
    draw_vehicle,
    empty_road,
    random_body,
    random_paint,
    true_boxes,
)
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counter import LiveTraffic
from vdet.traffic.counts import Counts

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

SECONDS, VEHICLES, RATE = 3600, 600, Fraction(25, 2)
EACH = VEHICLES // 20  # missed, false, and of a wrong class
ROADS = 12  # images of the empty road, which differ by their noise
SETTINGS = Settings.model_validate(
    {"traffic": {"lines": [{"name": "gate", "start": [0.02, 0.62], "end": [0.98, 0.62]}]}}
)
ACTIONS = """
<iframe id="hold"></iframe>
<script>
(async () => {
get("hold").contentDocument.open(); // the page has loaded when it is closed
const firstView = performance.now();
let taken = 0;
const times = { key: [], minute: [] };
const keyOf = name => String(data.classes.indexOf(name) + 1);
const painted = () => new Promise(done => requestAnimationFrame(() => setTimeout(done)));

async function shown() {
  const { start, end } = spanAt(current);
  const isShown = ({ minute }) => 60 * minute < end && 60 * minute + 60 > start;
  for (const strip of data.pictures.filter(isShown)) {
    const image = new Image();
    image.src = addressOf(`strip-${strip.band}-${strip.minute}`);
    await image.decode();
  }
  await painted();
}

async function press(key) {
  const begin = performance.now();
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  document.body.offsetHeight;
  await (key === "Enter" ? shown() : painted());
  times[key === "Enter" ? "minute" : "key"].push(performance.now() - begin);
  taken++;
}

/** Click at a point of the window if it hits the element; return whether it does. */
function click(element, clientX, clientY) {
  const target = document.elementFromPoint(clientX, clientY);
  if (target !== element && target?.closest(".mark, .column > i") !== element) return false;
  target.dispatchEvent(new MouseEvent("click", { clientX, clientY, bubbles: true }));
  taken++;
  return true;
}

async function select(id) {
  const mark = allMarks().find(item => item.id === id);
  const button = document.querySelector(`[data-key="${mark.key}"]`);
  button.scrollIntoView({ block: "center" });
  const box = button.getBoundingClientRect();
  for (const across of [0.5, 0.15, 0.85])
    for (const down of [0.5, 0.15, 0.85])
      if (click(button, box.left + across * box.width, box.top + down * box.height)) return;
  while (selected !== mark.key) await press("Tab");
}

async function add(error) {
  const picture = data.pictures.find(({ minute }) => minute === Math.floor(error.seconds / 60));
  const number = Math.floor((error.seconds - 60 * picture.minute) / picture.seconds);
  const at = `[data-at="${picture.band} ${picture.minute} ${number}"]`;
  const view = document.querySelector(`${at} > i`);
  const { x, y } = placeIn(picture, number, error.seconds, error.position);
  scrollBy(0, view.getBoundingClientRect().top + y * view.offsetHeight - innerHeight / 2);
  const box = view.getBoundingClientRect();
  click(view, box.left + x * box.width, box.top + y * box.height);
  if (classOf(selectedMark()) !== error.class) await press(keyOf(error.class));
  if (directionOf(selectedMark()) !== error.direction) await press("d");
}

await shown();
const view = performance.now(), each = {}, empty = [];
for (const { start, end } of data.spans) {
  const errors = ERRORS_OF_HOUR.filter(error => error.seconds >= start && error.seconds < end);
  for (const error of errors) {
    taken = 0;
    if (error.kind === "missed") await add(error);
    else {
      await select(error.id);
      await press(error.kind === "false" ? "x" : keyOf(error.class));
    }
    (each[error.kind] ??= []).push(taken);
  }
  taken = 0;
  await press("Enter");
  if (!errors.length) empty.push(taken);
}
const text = corrections();
document.title = JSON.stringify({ firstView, view, each, empty, times, corrections: text });
})().catch(error => { document.title = JSON.stringify(error.stack); })
  .finally(() => get("hold").contentDocument.close());
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


@dataclass(frozen=True)
class Hour:
    """A road, its vehicles with their classes, and the numbers of the wrong ones."""

    scene: Scene
    classes: dict[int, str]
    missed: frozenset[int]
    false: frozenset[int]
    renamed: frozenset[int]

    def tracks(self, index: int, *, is_true: bool, boxes: Sequence[TrueBox]) -> FrameTracks:
        """Return the true tracks of a frame, or those of the detector."""
        skipped = self.false if is_true else self.missed
        shown = []
        for item in boxes:
            if item.id in skipped or item.box.width < MIN_WIDTH * self.scene.camera.width:
                continue
            name = self.classes[item.id]
            if item.id in self.renamed and not is_true:
                name = "bus" if name == "truck" else "truck"
            shown.append(Track(item.id, item.box, 0.9, "detected", name))
        return FrameTracks(index, self.scene.time(index), tuple(shown))

    def at(self, index: int) -> Scene:
        """Return the scene with the vehicles of a frame only."""
        moment = self.scene.time(index)
        vehicles = tuple(
            vehicle
            for vehicle in self.scene.vehicles
            if vehicle.path[0].time <= moment <= vehicle.path[-1].time
        )
        return replace(self.scene, vehicles=vehicles)

    def frames(self) -> Iterator[Frame]:
        """Draw the hour."""
        renderer = Renderer(replace(self.scene, vehicles=()))
        roads = [renderer.image(index) for index in range(ROADS)]
        for index in range(self.scene.frames):
            image, scene = roads[index * 7 % ROADS].copy(), self.at(index)
            for position, vehicle in reversed(scene.nearest_first(scene.time(index))):
                if vehicle.id not in self.false:
                    draw_vehicle(image, vehicle, position, scene)
            yield Frame(index, index / RATE, Picture(image))


def hour(seed: int = 1) -> Hour:
    """Return the road; vehicles of a lane keep a distance of 1.5 s at least."""
    rng = np.random.default_rng(seed)
    scene = empty_road(rng, PinholeCamera.pole(960, 540), lane=1, lanes=4, seed=seed)
    total = VEHICLES + EACH  # the false ones are not there
    starts = np.sort(rng.uniform(0, SECONDS - 12, total))
    lanes, last = rng.integers(0, 4, total), np.full(4, -10.0)
    vehicles, classes = [], {}
    for number, (start, lane) in enumerate(zip(starts.tolist(), lanes.tolist(), strict=True), 1):
        first = last[lane] = max(start, last[lane] + 1.5)
        name = str(rng.choice(["car", "truck", "bus"], p=[0.8, 0.15, 0.05]))
        lateral, comes = (lane - 1) * LANE_WIDTH, lane < 2
        far, near = (90.0, -10.0) if comes else (-10.0, 90.0)
        ends = (first, far), (first + 100 / 15, near)
        path = tuple(Waypoint(moment, ahead, lateral, np.pi * comes) for moment, ahead in ends)
        body = random_body(rng) if name == "car" else LORRY
        vehicles.append(SceneVehicle(number, path, random_paint(rng), body))
        classes[number] = name
    chosen = [int(number) for number in rng.permutation(total)[: 3 * EACH] + 1]
    missed, false, renamed = (frozenset(chosen[part::3]) for part in range(3))
    road = replace(scene, roadside=(), speed=0.0, rate=RATE, frames=int(SECONDS * RATE))
    road = replace(road, vehicles=tuple(vehicles))
    return Hour(road, classes, missed, false, renamed)


def errors_of(
    road: Hour, counts: Counts, true: Counts, passages: Sequence[BandPassage]
) -> list[dict[str, Any]]:
    """Return what a reviewer sees, for the script, in the order of time.

    `kind` is missed, false or class; `class` is the true one.
    """
    kinds = {**dict.fromkeys(road.missed, "missed"), **dict.fromkeys(road.renamed, "class")}
    events = [event for event in true.events if event.id in kinds]
    events += [event for event in counts.events if event.id in road.false]
    positions = {passage.id: passage.position for passage in passages}
    return [
        {
            "kind": kinds.get(event.id, "false"),
            "id": event.id,
            "seconds": event.time,
            "position": positions.get(event.id, 0.5),
            "direction": event.direction,
            "class": road.classes[event.id],
        }
        for event in sorted(events, key=lambda event: event.time)
    ]


def write_page(road: Hour, folder: Path) -> tuple[Counts, Counts, list[dict[str, Any]]]:
    """Write the page; return its counts, the true ones, and the errors that a reviewer sees."""
    camera = road.scene.camera
    video = VideoInfo(Path("hour.mp4"), camera.width, camera.height, RATE, 1 / RATE)
    traffic, true = (LiveTraffic(SETTINGS, camera.width, camera.height) for _ in range(2))
    assert traffic.counter
    passages = Passages(bands_of(traffic.counter.lines))
    with OutputFiles(overwrite=True) as files:
        context = SinkContext(files, SETTINGS, video, traffic=traffic)
        with open_sinks([Output("review", folder)], context) as sinks:
            for frame in road.frames():
                boxes = true_boxes(road.at(frame.index), frame.index)
                tracks = road.tracks(frame.index, is_true=False, boxes=boxes)
                traffic.add(tracks)
                sinks.write(FrameResult(video.path, frame, NO_BOXES, tracks.tracks))
                true_tracks = road.tracks(frame.index, is_true=True, boxes=boxes)
                true.add(true_tracks)
                passages.add(true_tracks)
            traffic.end(Findings())
    true.end(Findings())
    counts, true_counts = traffic.counts(), true.counts()
    assert counts
    assert true_counts
    return counts, true_counts, errors_of(road, counts, true_counts, passages.by_band[0])


def measure_index(folder: Path) -> None:
    """Print the figures of the index."""
    page, begin = folder / "index.html", time.perf_counter()
    index_page(page)
    print(f"index of 100,000 vehicles: {time.perf_counter() - begin:.2f} s to make")
    for what, taken in in_chromium(page, {UPDATE: FIRST, "</body>": MEASURES}).items():
        print(f"  {what}: {taken:.0f} ms")


def measure_review(folder: Path) -> None:
    """Print the figures of the review."""
    road, begin = hour(), time.perf_counter()
    counts, true, errors = write_page(road, folder / "review")
    page = folder / "review" / REVIEW_NAME
    print(f"{len(counts.events)} counted, {len(true.events)} true, {len(errors)} errors")
    print(f"page: {page.stat().st_size / 1e6:.1f} MB, {time.perf_counter() - begin:.0f} s")
    script = ACTIONS.replace("ERRORS_OF_HOUR", json.dumps(errors))
    measured = in_chromium(page, {"</body>": script})
    first, whole = measured["firstView"], measured["view"]
    print(f"first view: {first:.0f} ms, with pictures {whole:.0f} ms")
    for what, taken in measured["times"].items():
        print(f"a {what}: median {np.median(taken):.0f} ms, at most {max(taken):.0f} ms")
    print(f"keys a minute without errors: {max(measured['empty'])}")
    for kind, taken in measured["each"].items():
        print(f"{kind}: {len(taken)} errors, {np.mean(taken):.2f} actions, most {max(taken)}")
    path = folder / "corrections.yaml"
    path.write_text(measured["corrections"], encoding="utf-8")
    corrected = apply_corrections({"": counts}, [Corrections.read(path)], SETTINGS)[""]
    print(f"counts by class are exact: {by_class(corrected) == by_class(true)}")


def main() -> None:
    measures = {"index": measure_index, "review": measure_review}
    for name in sys.argv[1:] or measures:
        with tempfile.TemporaryDirectory() as folder:
            measures[name](Path(folder))


if __name__ == "__main__":
    main()
