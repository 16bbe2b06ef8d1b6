"""`--sink NAME=FILE` on every command that has it."""

from pathlib import Path

import pytest

from conftest import Run
from red_cars import CAR, road
from running import names, write_drive
from vdet.media.images import read_image
from writing import write_image

FRAMES = 15
NAMES = "video image tracks json labels vehicles counts flows conditions stages crops clips page"
KNOWN = f"known: {', '.join(NAMES.split())}"


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return write_drive(tmp_path / "in" / "a.mp4", FRAMES)


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


class TestDetectVideo:
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


def test_a_sink_for_one_picture(run: Run, tmp_path: Path, out: Path, red: tuple[str, ...]) -> None:
    image = tmp_path / "red.png"
    write_image(image, road(CAR))
    sink = ("--sink", f"image={out}/a.png", *red)
    run("detect-image", image, *sink, code=0)
    assert (read_image(out / "a.png") != read_image(image)).any()
    before = (out / "a.png").read_bytes()
    twin = image.with_name("twin.png")
    write_image(twin, road())
    several = run("detect-image", twin, image, *sink, "--overwrite")
    assert several.code == 1
    assert "a.png: is for one image; for several, use a folder" in several.err
    assert (out / "a.png").read_bytes() == before


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (
            ("--sink", "tracks=a.csv"),
            2,
            "with -d, pass only the ending of the names: .txt, .csv, .jsonl",
        ),
        (
            ("--sink", "video=.avi"),
            2,
            "video: with -d, pass only the ending of the names: .mp4, .mov, .mkv",
        ),
        (("--sink", "json=.json"), 2, "json: cannot be written with -d"),
        (("--tracks", ".csv", "--sink", "tracks=.csv"), 1, "both would be written to"),
    ],
)
def test_what_a_batch_cannot_write_is_refused_before_any_work(
    run: Run, clip: Path, out: Path, arguments: tuple[str, ...], code: int, words: str
) -> None:
    result = run("detect-video", clip.parent, "-d", out, *arguments)
    assert (result.code, result.out) == (code, "")
    assert words in result.err
    assert names(out) == []
