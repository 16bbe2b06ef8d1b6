"""The sinks `vehicles` and `crops` in a run."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest

from red_cars import CAR, WIDTH
from run.red_runs import COUNT, outputs, result_of, run_red, write
from running import names, rows_of
from vdet.boxes import Box
from vdet.media.images import read_image
from vdet.run.sinks import Output
from vdet.run.steps import FrameResult
from vdet.run.video import Run


def test_a_run_writes_the_record_and_the_picture_of_its_car(red_clip: Path, tmp_path: Path) -> None:
    wanted = outputs(
        vehicles=tmp_path / "a.csv", crops=tmp_path / "crops", tracks=tmp_path / "tracks.csv"
    )
    run_red(Run(red_clip, wanted))
    tracks = rows_of(tmp_path / "tracks.csv")
    (row,) = rows_of(tmp_path / "a.csv")
    assert (row["id"], row["class"]) == ("1", "")
    assert float(row["first"]) == float(tracks[0]["time"])
    assert float(row["last"]) == float(tracks[-1]["time"])
    assert sum(int(row[state]) for state in ("detected", "interpolated", "predicted")) == len(
        tracks
    )
    assert float(row["length_fraction"]) == pytest.approx(float(row["length"]) / WIDTH, abs=1e-3)
    assert float(row["length"]) == pytest.approx(COUNT, abs=COUNT / 4), "a pixel a frame"
    (name,) = names(tmp_path / "crops")
    assert name.startswith("vehicle-0001-at-")
    time = float(name.removeprefix("vehicle-0001-at-").removesuffix("s.jpg"))
    assert time in {round(float(track["time"]), 3) for track in tracks}
    blue, _, red = read_image(tmp_path / "crops" / name).reshape(-1, 3).mean(axis=0)
    assert red > blue + 50


def test_a_better_picture_replaces_that_of_a_vehicle_that_was_gone(tmp_path: Path) -> None:
    large = Box.sized(50, 50, 80, 60)
    results = [
        result_of(CAR, time=Fraction(0)),
        result_of(index=1, time=Fraction(1)),
        result_of(large, index=2, time=Fraction(2)),
    ]
    write(Output("crops", tmp_path), results)
    assert names(tmp_path) == ["vehicle-0001-at-2.000s.jpg"]


def test_pictures_of_an_earlier_run_go(tmp_path: Path) -> None:
    write(Output("crops", tmp_path), [result_of(CAR, CAR)])
    mine = ["vehicle-0001-car-at-0.000s.txt", "vehicle-0002-at-home.jpg", "vehicle-list.txt"]
    for name in mine:
        (tmp_path / name).write_text("mine")
    write(Output("crops", tmp_path), [result_of(CAR, time=Fraction(3))])
    assert names(tmp_path) == sorted(["vehicle-0001-at-3.000s.jpg", *mine])


def test_thousands_of_vehicles_do_not_need_thousands_of_open_files(tmp_path: Path) -> None:
    opened = []

    def results() -> Iterator[FrameResult]:
        for number in range(50):
            yield result_of(*[CAR] * (number + 1), index=2 * number, time=Fraction(number))
            opened.append(len(list(Path("/proc/self/fd").iterdir())))
            yield result_of(index=2 * number + 1, time=Fraction(2 * number + 1, 2))

    write(Output("crops", tmp_path), results())
    assert len(set(opened)) == 1
    assert len(names(tmp_path)) == 50
