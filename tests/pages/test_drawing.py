"""The page of `vdet draw` in a real browser, and what it is made from."""

import json
import random
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.pole_cameras import pole_scene

from browser import CONTROL, DELETE, ENTER, ESCAPE, SHIFT, Browser, browser, downloaded
from traffic.scenes import HEIGHT, LINE, WIDTH, ZONE, counts, frames, named, settings_for, through
from vdet.boxes import Box
from vdet.config.loading import given_values, load_settings, parse_document
from vdet.config.schema import Settings
from vdet.findings import Finding
from vdet.lanes.camera import Undistorter, fit_ground, ground_of
from vdet.pages.traffic import Drawing
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.counting import count_frames
from vdet.traffic.crossings import Border, crossings, lines_and_zones

DOWN = [through((n, 380 + 60 * n, 60), (4 + n, 360 + 80 * n, 700)) for n in range(6)]
RIGHT = [through((n, 20, 330 + 10 * n), (5 + n, 1260, 350 + 10 * n)) for n in range(5)]
NAME = "<img src=x onerror=document.title=1>"


@pytest.fixture
def window(tmp_path: Path) -> Iterator[Browser]:
    with browser(tmp_path) as opened:
        yield opened


def drawing(
    video: Sequence[FrameTracks], values: dict[str, Any] | None = None, settings: Any = None
) -> Drawing:
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    return Drawing(image, video, settings or Settings(), values or {})


def written(folder: Path, made: Drawing) -> Path:
    page = folder / "page.html"
    page.write_bytes(made.output(page, "gate.yaml"))
    return page


def wandering(seed: int, vehicles: int = 40) -> list[FrameTracks]:
    """Give tracks that turn, stop, flicker and end anywhere."""
    rng = random.Random(seed)
    rows: list[list[Track]] = [[] for _ in range(200)]
    for number in range(1, vehicles + 1):
        x, y = rng.uniform(0, WIDTH), rng.uniform(0, HEIGHT)
        speed, heading, height = rng.uniform(0, 14), rng.uniform(0, 6.3), rng.randint(20, 120)
        for row in rows[(first := rng.randint(0, 150)) : first + rng.randint(5, 150)]:
            heading += rng.gauss(0, 0.15)
            x, y = x + speed * np.cos(heading), y + speed * np.sin(heading)
            if rng.random() < 0.9:
                foot = round(x + rng.gauss(0, 1), 2), round(y + rng.gauss(0, 1), 2)
                box = Box.sized(round(x) - height // 2, round(y) - height, height, height)
                row.append(Track(number, box, 0.9, "detected", rng.choice(("car", "truck")), foot))
    return [FrameTracks(index, index / 25, tuple(row)) for index, row in enumerate(rows)]


def test_the_page_counts_as_python_does(window: Browser, tmp_path: Path) -> None:
    """The rule is in both; here both get the same paths, as they are packed, and places."""
    at_edge = LINE.model_copy(update={"name": "edge", "start": (0, 300), "end": (1280, 500)})
    steep = LINE.model_copy(update={"name": "steep", "start": (640, 0), "end": (600, 719.5)})
    corner = ZONE.model_copy(
        update={"name": "corner", "points": ((0, 0), (500, 0), (300, 350), (0, 400))}
    )
    settings = settings_for(LINE, at_edge, steep, ZONE, corner)
    for seed in range(4):
        made = drawing(wandering(seed), json.loads(settings.model_dump_json()), settings)
        lines, zones = lines_and_zones(settings.traffic, WIDTH, HEIGHT)
        borders: tuple[Border, ...] = *lines, *zones
        expected = [
            [path.vehicle, border.name, crossing.direction, crossing.row, round(crossing.time, 3)]
            for border in borders
            for path in made.paths
            for crossing in crossings(path, border)
        ]
        assert len(expected) > 30
        window.open(written(tmp_path, made))
        found = window.run(
            """
            const data = JSON.parse(get("data").textContent);
            const borders = [...data.places.lines.map(line => placeLine(line, data.size)),
              ...data.places.zones.map(zone => placeZone(zone, data.size))];
            const row = (path, border, { direction, row, time }) =>
              [path.vehicle, border.name, direction, row, Math.round(1000 * time) / 1000];
            return readPaths(data.paths).then(paths => borders.flatMap(border => paths.flatMap(
              path => crossings(path, border).map(each => row(path, border, each)))));
            """
        )
        assert found == expected


def test_a_line_is_drawn_dragged_named_saved_and_opened_again(
    window: Browser, tmp_path: Path
) -> None:
    video = list(frames(*DOWN))
    page = written(tmp_path, drawing(video))
    window.open(page)
    window.type("l")
    window.click((200, 400), (500, 420))
    window.type("gate", ENTER)
    assert "up 0 · down 2" in window.text("#list")
    window.drag((500, 420), (700, 440), (1000, 400))
    assert "up 0 · down 6" in window.text("#list")
    window.type("s", CONTROL + "s")
    saved = downloaded(tmp_path, "gate.yaml")
    settings = load_settings([saved])
    [line] = settings.traffic.lines
    assert (line.name, line.left, line.right) == ("gate", "down", "up")
    totals = count_frames(video, settings, (WIDTH, HEIGHT)).totals
    assert [(total.direction, total.count) for total in totals] == [("down", 0), ("up", 6)]
    window.type(CONTROL + "z", CONTROL + "z", CONTROL + "z")
    assert window.text("#list").startswith("line 1")
    window.choose_file("#open", saved)
    window.wait("return document.getElementById('hint').textContent === 'Opened gate.yaml.'")
    assert window.text("#list") == "gatedown 0 · up 6"
    assert window.text("#text") == saved.read_text()


def test_a_line_has_fields_for_the_side_that_is_in_and_for_its_approach(
    window: Browser, tmp_path: Path
) -> None:
    window.open(written(tmp_path, drawing(list(frames(*DOWN)))))
    window.type("l")
    window.click((200, 400), (1000, 420))
    for field, value in (("in", "down"), ("approach", "NE"), ("in", ""), ("in", "up")):
        window.run(
            "const field = get(`field-${arguments[0]}`); field.value = arguments[1];"
            "field.dispatchEvent(new Event('change'))",
            *(field, value),
        )
        assert window.run("return get(`field-${arguments[0]}`).value", field) == value
        [line] = parse_document(window.text("#text"), "text").values["traffic"]["lines"]
        sides = {"down": ("out", "in"), "up": ("in", "out")}.get(
            value, (line["left"], line["right"])
        )
        assert (line["left"], line["right"]) == sides
    assert line["approach"] == "NE"
    assert "in 0 · out 6" in window.text("#list")


def test_zones_regions_and_points_are_drawn_by_keys_and_undone(
    window: Browser, tmp_path: Path
) -> None:
    window.open(written(tmp_path, drawing(list(frames(*DOWN, *RIGHT)))))
    window.type("z")
    window.click((300, 300), (900, 300), (900, 500), (300, 500), (300, 302))
    window.type("junction", ENTER)
    assert "junctionenter 11 · exit 11" in window.text("#list")
    window.type("x")
    window.click((0, 0), (250, 0), (250, 720), (0, 720))
    window.type(ENTER, ESCAPE)
    assert "junctionenter 11 · exit 11" in window.text("#list")
    window.type("i")
    window.click((200, 600), (1270, 600), (1270, 710))
    window.type(ENTER, ENTER)
    assert "junctionenter 0" in window.text("#list")
    window.type(CONTROL + "z")
    assert "junctionenter 11" in window.text("#list")
    window.type(CONTROL + SHIFT + "z")
    assert "junctionenter 0" in window.text("#list")
    window.type(CONTROL + "z", "g")
    for point, metres in (
        ((100.5, 700.5), ("0", "0")),
        ((1100.5, 700.5), ("10", "0")),
        ((800.5, 100.5), ("10", "50")),
        ((400.5, 100.5), ("0", "50")),
    ):
        window.click(point)
        window.type(metres[0], ENTER, metres[1], ENTER)
    texts = window.run(
        "return [...document.querySelectorAll('.ground text')].map(e => e.textContent)"
    )
    assert texts == ["1: 0, 0 m", "2: 10, 0 m", "3: 10, 50 m", "4: 0, 50 m"]
    assert window.run("return document.querySelectorAll('#marks polyline.grid').length") > 10
    values = parse_document(window.text("#text"), "text").values
    assert [value["metres"] for value in values["camera"]["ground"]] == [
        [0, 0],
        [10, 0],
        [10, 50],
        [0, 50],
    ]
    assert [value["kind"] for value in values["regions"]] == ["exclude"]
    window.type(ESCAPE)
    window.click((320, 480))
    window.type(DELETE)
    assert "zones" not in window.text("#text")


@pytest.mark.parametrize(
    ("fields", "focal"),
    [
        ({"length-1": "3", "length-3": "9"}, 1600.0),
        ({"lane-width": "3.5", "length-1": "24"}, 1600.0),
        ({"lane-width": "3.5"}, 1280.0),
    ],
    ids=["two lengths", "a width and a length", "a width and a usual lens"],
)
def test_known_lengths_along_a_lane_give_the_ground_and_its_width_alone_no_speeds(
    window: Browser, tmp_path: Path, fields: dict[str, str], focal: float
) -> None:
    # A level camera 8 m above the road, tilted by 12 degrees; the lane runs 6 degrees to the right.
    tilt, turn, is_width = np.radians(12), np.radians(6), "lane-width" in fields

    def seen(along: float, across: float = 0) -> tuple[float, float]:
        x = 1.5 + along * np.sin(turn) + across * np.cos(turn)
        z = along * np.cos(turn) - across * np.sin(turn)
        depth = z * np.cos(tilt) + 8 * np.sin(tilt)
        down = 8 * np.cos(tilt) - z * np.sin(tilt)
        return 640 + focal * x / depth, 360 + focal * down / depth

    window.open(written(tmp_path, drawing(list(frames(*DOWN)))))
    window.type("m")
    lane = [(22, 0), (46, 0), (22, 3.5), (46, 3.5)]
    for point in lane if is_width else [(22,), (25,), (46,), (55,)]:
        window.click(seen(*point))
    texts = window.run(
        "return [...document.querySelectorAll('#marks > text')].map(e => e.textContent)"
    )
    assert texts == ["1", "2", "3", "4"]
    assert "ground" not in window.text("#text")
    for name, value in fields.items():
        window.run("get(arguments[0]).focus()", name)
        window.type(value)
    window.type(ENTER)
    camera = parse_document(window.text("#text"), "text").values["camera"]
    values, is_guess = camera["ground"], len(fields) == 1 and is_width
    assert ("no speeds" in window.text("#warnings")) == is_guess
    (tmp_path / "gate.yaml").write_text(window.text("#text"))
    settings = load_settings([tmp_path / "gate.yaml"])
    assert (ground_of(settings.camera, 1280, 720) is None) == is_guess
    (*_, finding) = VehicleCounter(settings, 1280, 720).counts().findings or (Finding("", ""),)
    assert ("camera.ground: no speeds: " in finding.text) == is_guess
    ground = fit_ground(
        np.array([value["pixel"] for value in values]) + 0.5,
        np.array([value["metres"] for value in values]),
        Undistorter(None, 1280, 720),
    )
    assert "cars are" not in window.text("#warnings")
    middle = ground.metres(np.array([seen(along) for along in (20.0, 30.0, 40.0, 50.0, 60.0)]))
    steps = np.hypot(*np.diff(middle, axis=0).T)
    assert steps == pytest.approx([10, 10, 10, 10], rel=0.02)


def test_metres_by_which_cars_are_far_too_wide_have_a_warning(
    window: Browser, tmp_path: Path
) -> None:
    window.open(written(tmp_path, drawing(named(frames(*DOWN), "car"))))
    for width in (8, 100):
        window.type("m")
        window.click((300, 700), (500, 300), (1000, 700), (800, 300))
        window.run("get('lane-width').focus()")
        window.type(str(width), ENTER)
        warning = window.run("return get('warnings').lastChild.textContent")
        assert ("cars are" in warning) == (width == 100)
    assert warning == "ground: cars are 19.7 m wide by these points; check their metres"


def test_a_finger_draws_on_a_small_screen(tmp_path: Path) -> None:
    with browser(tmp_path, 390, 844, touch=True) as window:
        window.open(written(tmp_path, drawing(list(frames(*DOWN)))))
        assert window.run("return document.documentElement.scrollWidth") == 390
        window.type("l")
        window.drag((200, 400), (600, 420), (1000, 400), kind="touch")
        assert "up 0 · down 6" in window.text("#list")


def test_what_a_file_has_already_is_carried_through(window: Browser, tmp_path: Path) -> None:
    given = tmp_path / "given.yaml"
    given.write_text(
        f"""
camera:
  size: [640, 360]
  clock: {{pattern: "%Y%m%d_%H%M%S"}}
  lens:
    size: [320, 180]
    matrix: [[300.0, 0.0, 160.0], [0.0, 300.0, 90.0], [0.0, 0.0, 1.0]]
    distortion: [0.0, 0.0, 0.0, 0.0, 0.0]
detector: {{model: mine.onnx}}
regions: [{{name: ramp, mask: ramp.png}}]
traffic:
  interval: 15min
  lines:
    - {{name: "{NAME}", start: [100, 200], end: [500, 200], left: "\\x7f\\x85\\u2028", approach: N}}
  zones: [{{name: closed, flows: false, points: [[50, 50], [150, 50], [100, 150], [50, 50]]}}]
"""
    )
    values = given_values([str(given)])
    made = drawing(list(frames(*DOWN)), values)
    window.open(written(tmp_path, made))
    for _ in range(2):
        text = window.text("#text")
        found = parse_document(text, "text").values
        assert found["camera"] == {
            "size": [1280, 720],
            "clock": {"pattern": "%Y%m%d_%H%M%S"},
            "lens": values["camera"]["lens"],
        }
        assert found["detector"] == {"model": "mine.onnx"}
        assert found["regions"] == [{"name": "ramp", "mask": "ramp.png"}]
        [line], [zone] = found["traffic"].pop("lines"), found["traffic"].pop("zones")
        assert found["traffic"] == {"interval": "15min"}
        assert (line["name"], line["start"], line["left"]) == (NAME, [200, 400], "\x7f\x85\u2028")
        assert zone["points"] == [[100, 100], [300, 100], [200, 300]]
        assert (line["approach"], zone["flows"]) == ("N", False)
        assert window.run("return get('save').disabled") is False
        (saved := tmp_path / "saved.yaml").write_text(text)
        window.choose_file("#open", saved)
        window.wait("return get('hint').textContent === 'Opened saved.yaml.'")
    assert window.run("return [document.title, document.images.length]") == ["Draw gate.yaml", 0]
    window.choose_file("#open", given)
    window.wait("return get('hint').textContent.includes('not written by this page')")
    (page := tmp_path / "page.html").write_bytes(made.output(page, "gate\nsteps: [x].yaml"))
    window.open(page)
    assert "steps" not in parse_document(window.text("#text"), "text").values


def test_warnings_are_those_of_a_run(window: Browser, tmp_path: Path) -> None:
    nobody = LINE.model_copy(update={"name": "nobody", "start": (1100, 20), "end": (1250, 60)})
    short = LINE.model_copy(update={"name": "short", "start": (395, 300), "end": (420, 300)})
    begins = LINE.model_copy(update={"name": "begins", "start": (200, 70), "end": (1000, 70)})
    video = list(frames(*DOWN, seconds=14))
    settings = settings_for(LINE, nobody, short, begins)
    made = drawing(video, json.loads(settings.model_dump_json()), settings)
    window.open(written(tmp_path, made))
    shown = window.run(
        "return [...document.querySelectorAll('#warnings li')].map(e => e.textContent)"
    )
    findings = counts(video, LINE, nobody, short, begins).findings
    assert shown == [finding.text for finding in findings]
    assert len(shown) > 2


def test_vehicles_that_stand_are_drawn_and_not_counted(window: Browser, tmp_path: Path) -> None:
    visit = through((0, 200, 420), (2, 700, 420), (7, 702, 421), (9, 1000, 420))
    parked = [through((0, x, 400), (5, x + 20, 404), (10, x, 402)) for x in (500, 600, 700)]
    settings = settings_for(ZONE)
    video = list(frames(visit, *parked))
    values = json.loads(settings.model_dump_json())
    window.open(written(tmp_path, drawing(video, values, settings)))
    assert window.text("#list") == "zoneenter 1 · exit 1"
    totals = count_frames(video, settings, (WIDTH, HEIGHT)).totals
    assert [total.count for total in totals] == [1, 1, 0, 0]
    window.type("i")  # only where it stands, which is what a run would see of it
    window.click((685, 300), (708, 300), (708, 500), (685, 500))
    window.type(ENTER, ENTER)
    assert window.text("#list") == "zoneenter 0 · exit 0region 1include"


def test_drawn_scenes_have_the_same_counts_and_flows(window: Browser, tmp_path: Path) -> None:
    scene = pole_scene("turning", 8.0, seed=1)
    video = list(scene.true_tracks(every=2))
    values = json.loads(scene.settings.model_dump_json())
    window.open(written(tmp_path, drawing(video, values, scene.settings)))
    expected = count_frames(video, scene.settings, (WIDTH, HEIGHT))
    rows = window.run(
        "const texts = row => [...row.children].map(cell => cell.textContent);"
        "return [...document.querySelectorAll('#flows tr')].map(texts)"
    )
    flows: Counter[tuple[str, str]] = Counter()
    for heading, *cells in rows[1:]:
        for name, cell in zip(rows[0][1:], cells, strict=True):
            flows[heading, name.removeprefix("to ")] += int(cell)
    wanted: Counter[tuple[str, str]] = Counter()
    for row in expected.flows():
        wanted[row.origin, row.destination or "none"] += row.count
    assert +flows == +wanted
    totals = {(total.name, total.direction): total.count for total in expected.totals}
    for line in scene.settings.traffic.lines:
        left, right = totals[line.name, "left"], totals[line.name, "right"]
        assert f"{line.name}left {left} · right {right}" in window.text("#list")
