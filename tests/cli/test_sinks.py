"""`--sink NAME=FILE` on every command that has it, and the outputs of a run all together."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from conftest import Run
from red_cars import CAR, road
from running import names, write_drive
from vdet.media.images import read_image, write_image
from vdet.run.sinks.data import TrackSink
from vdet.run.sinks.drawn import VideoSink

FRAMES = 15
KNOWN = "known: video, tracks, stages, picture, json, labels, vehicles, crops, clips, page, counts"


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return write_drive(tmp_path / "in" / "a.mp4", FRAMES)


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "red.png"
    write_image(path, road(CAR))
    return path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


def lines_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


class TestDetectVideo:
    def test_a_sink_gets_the_same_results_as_the_options(
        self, run: Run, clip: Path, out: Path, red: tuple[str, ...]
    ) -> None:
        options = ("--tracks", out / "a.jsonl", "--sink", f"tracks={out}/b.csv", *red)
        result = run("detect-video", clip, out / "a.mp4", *options)
        assert result.code == 0, result.err
        assert names(out) == ["a.jsonl", "a.mp4", "b.csv"]
        with (out / "b.csv").open() as file:
            rows = [(int(row["frame"]), int(row["x"])) for row in csv.DictReader(file)]
        records = lines_of(out / "a.jsonl")
        assert rows == [
            (record["frame"], track["x"]) for record in records for track in record["tracks"]
        ]
        assert rows, "nothing was found: the test would say nothing"

    @pytest.mark.parametrize("text", ["tracks", "tracks=", "=a.csv", "=", ""])
    def test_another_text_than_name_and_file_is_wrong_usage(
        self, run: Run, clip: Path, out: Path, text: str
    ) -> None:
        result = run("detect-video", clip, out / "a.mp4", "--sink", text)
        assert result.code == 2
        assert f"{text}: expected NAME=FILE, as in tracks=out.csv" in result.err
        assert names(out) == []

    @pytest.mark.parametrize(
        ("sink", "words"),
        [
            ("tallies=a.csv", f"tallies: unknown sink; {KNOWN}"),
            ("tracks=a.json", "a.json: tracks must end in .txt, .csv, .jsonl, "),
            ("tracks=none/a.csv", "none/a.csv: the folder none does not exist; create it first"),
            ("tracks=old.csv", "old.csv: already exists; use --overwrite to replace it"),
            ("picture=a.png", "a.png: the sink picture is for pictures"),
            ("tracks=t.txt", "t.txt: is used for two outputs; rename one"),
        ],
    )
    def test_an_output_that_cannot_be_is_refused_before_any_work(
        self,
        run: Run,
        clip: Path,
        out: Path,
        sink: str,
        words: str,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(out)
        (out / "old.csv").write_text("precious")
        result = run("detect-video", clip, "a.mp4", "--tracks", "t.txt", "--sink", sink)
        assert (result.code, result.out) == (1, "")
        assert result.err.startswith(f"vdet: {words}")
        assert result.err.count("\n") == 1
        assert names(out) == ["old.csv"]


FULL = OSError(28, "No space left on device")


def failing_exit(sink: type[TrackSink | VideoSink], error: Exception) -> Callable[..., None]:
    """Return an end of a sink that does its work and then fails."""
    leave = sink.__exit__

    def fail(opened: Any, *raised: Any) -> None:
        leave(opened, *raised)
        raise error

    return fail


class TestTogether:
    """All files of a run appear at its end, or none does."""

    @pytest.mark.parametrize("failing", [TrackSink, VideoSink])
    @pytest.mark.parametrize("error", [FULL, RuntimeError("a bug")])
    def test_a_sink_that_fails_at_its_end_leaves_nothing_and_can_be_repeated(
        self,
        run: Run,
        clip: Path,
        out: Path,
        red: tuple[str, ...],
        monkeypatch: pytest.MonkeyPatch,
        failing: type[TrackSink | VideoSink],
        error: Exception,
    ) -> None:
        command = ("detect-video", clip, out / "a.mp4", "--tracks", out / "a.csv",
                   "--sink", f"tracks={out}/b.txt", "--stages", out / "stages", "--at", "0.2",
                   *red)  # fmt: skip
        with monkeypatch.context() as patch:
            patch.setattr(failing, "__exit__", failing_exit(failing, error))
            result = run(*command)
        assert result.code == 1
        assert result.err.count("\n") == 1, result.err
        assert names(out) == []
        again = run(*command)
        assert again.code == 0, again.err
        stages = [f"stages/{number}-{name}.png" for number, name in enumerate(
            ("windows", "hits", "heat", "boxes"), start=1)]  # fmt: skip
        assert names(out) == ["a.csv", "a.mp4", "b.txt", *stages]


class TestDetectImage:
    def test_a_sink_gets_the_results_of_all_pictures(
        self, run: Run, picture: Path, out: Path, red: tuple[str, ...]
    ) -> None:
        empty = picture.with_name("empty.png")
        write_image(empty, road())
        options = ("--json", "-", "--sink", f"json={out}/b.json", *red)
        result = run("detect-image", picture, empty, *options)
        assert result.code == 0, result.err
        assert (out / "b.json").read_text() == result.out
        (found,) = json.loads(result.out)[0]["boxes"]
        assert found.keys() >= {"x", "y", "width", "height", "score", "class"}
        assert 0 < found["score"] <= 1
        assert json.loads(result.out)[1]["boxes"] == []

    def test_a_sink_for_one_picture(
        self, run: Run, picture: Path, out: Path, red: tuple[str, ...]
    ) -> None:
        sink = ("--sink", f"picture={out}/a.png", *red)
        assert run("detect-image", picture, *sink).code == 0
        assert (read_image(out / "a.png") != read_image(picture)).any()
        before = (out / "a.png").read_bytes()
        twin = picture.with_name("twin.png")
        write_image(twin, road())
        several = run("detect-image", twin, picture, *sink, "--overwrite")
        assert several.code == 1
        assert "a.png: is for one image; for several, use a folder" in several.err
        assert (out / "a.png").read_bytes() == before


class TestBatch:
    @pytest.mark.parametrize(
        ("arguments", "code", "words"),
        [
            (("--sink", "tracks"), 2, "tracks: expected NAME=FILE"),
            (
                ("--sink", "tracks=a.csv"),
                2,
                "with -d, pass only the ending of the names: .txt, .csv, .jsonl",
            ),
            (
                ("--sink", "tracks=.json"),
                2,
                "with -d, pass only the ending of the names: .txt, .csv, .jsonl",
            ),
            (
                ("--sink", "video=.avi"),
                2,
                "video: with -d, pass only the ending of the names: .mp4, .mov, .mkv",
            ),
            (("--sink", "json=.json"), 2, "json: cannot be written with -d"),
            (("--sink", "stages=.png", "--at", "1"), 2, "stages: cannot be written with -d"),
            (("--sink", "tallies=.csv"), 1, f"tallies: unknown sink; {KNOWN}"),
            (("--tracks", ".csv", "--sink", "tracks=.csv"), 1, "both would be written to"),
        ],
    )
    def test_what_cannot_be_is_refused_before_any_work(
        self,
        run: Run,
        clip: Path,
        out: Path,
        arguments: tuple[str, ...],
        code: int,
        words: str,
    ) -> None:
        result = run("detect-video", clip.parent, "-d", out, *arguments)
        assert (result.code, result.out) == (code, "")
        assert words in result.err
        assert names(out) == []
