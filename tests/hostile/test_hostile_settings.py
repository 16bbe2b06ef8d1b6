"""Damaged and hostile YAML: settings and cameras, through the whole of `vdet detect-image`."""

import codecs
from itertools import pairwise
from pathlib import Path

import pytest

from hostile.mutations import mutated, with_other_words
from hostile.trials import try_files
from quick import only_windows
from vdet.config.loading import MAX_BYTES, MAX_MISTAKES, load_settings
from vdet.errors import ConfigError

SETTINGS = """\
# for one picture
detector:
  kind: svm
  search:
    probability: 0.5
    windows:
    - {size: 160, overlap: 0.5, top: 380, bottom: 600}
    - size: 240
      overlap: 0.75
      top: 300
      bottom: 700
    perspective: {sizes: [0.25, 0.5], horizon: 0.45}
  heat: {frames: 3, votes: 0.2, threshold: 5e-1}
  score: {middle: 0.3, slope: 2}
tracker:
  kind: rules
  history: 10
  min_region: 50
  match_distance: 40
lanes:
  points: [[0.2, 0.9], [0.8, 0.9], [0.54, 0.63], [0.46, 0.63]]
  metres: [3.7, 37.0]
output:
  preset: 'superfast'
  crf: 20
"""
MOTION = """\
tracker:
  kind: motion
  min_size: 0.03
  confirm_seconds: 0.25
  decay: 1e-1
  coast_seconds: 1
input: {max_damaged: 0.1, frame_rate: 30}
draw: {label: [id, score], trails: 2}
"""
CAMERA = """\
camera:
  lens:
    # frame size, pixels
    size: [1280, 720]
    matrix:
      - [1157.0, 0.0, 668.0]
      - [0.0, 1153.5, 388.25]
      - [0.0, 0.0, 1.0]
    distortion: [-0.25, 1e-2, 0.0, 0.0, 0.0]
"""
TOKENS = (
    *("&a ", "*a", "<<: *a", "!!python/object/apply:os.system [id]", "!!binary x", "!!set {a, b}"),
    *("---\n", "...\n", "%YAML 9.9\n", "%TAG ! x\n", "? ", "- ", ": ", "{", "}", "[", "]", "|\n"),
    *("'", '"', "#", "\t", "\r", "\0", "\n", "  ", "\x85", "\ufeff", '"\\UFFFFFFFF"', '"\\ud800"'),
    *("0", "-1", "1e999", ".inf", ".nan", "9" * 30, "0x" + "f" * 40, "1:60:60", "99999", "null"),
    *("true", "~", "2001-99-99", "heat", "windows", "rules", "motion", "1e-300", "100000", "0.99"),
    *("\xff", "é", "🚗"),
)
NUMBERS = (
    *("0", "1", "2", "-1", "0.01", "0.99", "0.999999", "1", "8", "16", "99999", "100000"),
    *("4294967296", "-9223372036854775808", "1e-300", "1e300", "1e999", ".inf", "-.inf", ".nan"),
    *("true", "null", "[]", "{}", "[1, 2, 3]", "2001-01-01", "1:60:60", "none", "patch", "dense"),
)


def test_damaged_yaml_files_are_read_or_refused(tmp_path: Path, picture: Path) -> None:
    settings = mutated(SETTINGS.encode(), seed=1, count=60, tokens=TOKENS)
    settings += with_other_words(SETTINGS, NUMBERS, seed=2, count=60)
    settings += with_other_words(MOTION, NUMBERS, seed=5, count=20)
    few = only_windows("size: 160, overlap: 0.5, top: 380, bottom: 600")
    cameras = mutated(CAMERA.encode(), seed=3, count=20, tokens=TOKENS)
    cameras += with_other_words(CAMERA, NUMBERS, seed=4, count=40)
    contents = {f"settings-{number}.yaml": data for number, data in enumerate(settings)}
    contents |= {f"camera-{number}.yaml": data for number, data in enumerate(cameras)}
    assert len(contents) == 200

    def arguments(path: Path, out: Path) -> list[str | Path]:
        of_camera = ("--lanes", *few) if path.name.startswith("camera") else ()
        return ["detect-image", picture, "-o", out / f"{path.stem}.png", *of_camera, "-c", path]

    trials = try_files(tmp_path, contents, arguments, lines=MAX_MISTAKES + 1)
    read = [trial.code == 0 for trial in trials]
    assert sum(read[: len(settings)]) > 4
    assert sum(read[len(settings) :]) > 4


ALIAS_BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 9)}]\n" for old, new in pairwise("abcdefghi")
)
HOSTILE = {
    "alias bomb": (ALIAS_BOMB, r"2:8: is not YAML: aliases \(\*name\) are not accepted"),
    "python object": ("detector: !!python/object/apply:os.system id", "1:11: .*could not determ"),
    "deep list": ("[" * 90_000, "is not YAML: maximum recursion depth exceeded"),
    "huge number": ("input: {x: " + "9" * 90_000 + "}", "1:12: is not YAML: Exceeds the limit"),
    "half a character": (r'draw: {colors: "\ud800"}', r"draw\.colors: .*got '\\ud800'"),
    "half a character as kind": (r'detector: {kind: "\ud800"}', r"\\ud800.*: unknown detector"),
    "not a number": ("input: {max_damaged: .nan}", "input.max_damaged: must be a finite number"),
    "9,000 unknown keys": ("".join(f"k{i}: 1\n" for i in range(9000)), "k0: unknown setting"),
    "15,000 wrong items": ("traffic:\n  lines:\n" + "  - 1\n" * 15_000, "must be a section"),
    "control characters": (r'"a\n\e[2J": 1', r"a\\n\\x1b\[2J: unknown setting"),
    "a long quoted key": ('? "' + "k" * 90_000 + '"\n: 1', "k…: unknown setting"),
    "too large": ("#" * (MAX_BYTES + 1), "is larger than 100,000 bytes, too large for a settings"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_yaml_is_refused_with_a_reason(tmp_path: Path, name: str) -> None:
    text, words = HOSTILE[name]
    path = tmp_path / "my.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=words) as error:
        load_settings([path], detector="svm")
    lines = str(error.value).splitlines()
    assert 1 <= len(lines) <= MAX_MISTAKES + 1
    assert all(line.isprintable() and len(line) < 1000 for line in lines)


@pytest.mark.parametrize(
    "data",
    [
        "input: {x: 2}".encode("utf-16"),
        "input: {x: 2}".encode("utf-32"),
        "input: {x: é}".encode("latin-1"),
        codecs.BOM_UTF16_LE,
        b"input: {x: \xed\xa0\x80}",
        b"\xc0\x80: 1",
    ],
)
def test_other_encodings_than_utf_8_are_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "my.yaml"
    path.write_bytes(data)
    with pytest.raises(ConfigError, match=r"my\.yaml: is not UTF-8 text"):
        load_settings([path])
