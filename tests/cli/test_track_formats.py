"""All formats of tracks in one run and in a batch, and as what `vdet eval` takes."""

import json
from pathlib import Path

import pytest

from conftest import Run
from running import names, write_drive
from vdet.labels.formats import track_suffixes
from vdet.labels.reading import read_tracks

ENDINGS = track_suffixes()
RESULTS = [ending for ending in ENDINGS if ending != ".txt"]
"""Endings of tracks that are truth too; MOTChallenge has another form for it."""


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return write_drive(tmp_path / "in" / "a.mp4", 15)


def test_one_run_writes_every_format_and_each_is_read_as_the_same_tracks(
    run: Run, clip: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    first, *others = ENDINGS
    wanted = [word for ending in others for word in ("--tracks", tmp_path / f"a{ending}")]
    wanted += ["--sink", f"tracks={tmp_path}/a{first}", "--tracks", "-"]
    done = run("detect-video", clip, "--no-video", *wanted, *red, code=0)
    assert done.out == (tmp_path / "a.jsonl").read_text()
    assert {f"a{ending}" for ending in ENDINGS} <= set(names(tmp_path))
    assert len(read_tracks(tmp_path / "a.csv").labels) > 5
    for ending in ENDINGS:
        truth = tmp_path / f"a{RESULTS[ENDINGS.index(ending) - 1]}"
        compared = run("eval", "tracks", tmp_path / f"a{ending}", truth, "--json", "-", code=0)
        values = json.loads(compared.out)
        assert (values["f1"], values["idf1"]) == (1, 1), ending
        assert values["mean_iou"] == pytest.approx(1, abs=1e-3)
