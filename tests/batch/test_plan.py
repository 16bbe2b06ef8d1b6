"""The videos of a batch, its plan, and what is refused before any work."""

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from clips import write_clip
from running import write_drive
from vdet.batch import ManifestRecord, Plan, Written, find_sources, make_plan, open_manifest
from vdet.errors import BatchError, OutputError
from vdet.run.sinks import Output, data
from vdet.run.sinks.protocol import BatchTotal, output_state
from vdet.run.video import Run

COMMON = Run(Path(), frames=7)
VIDEO: dict[str, str | None] = {"video": None}
TRACKS: dict[str, str | None] = {"tracks": ".csv"}
FOLDERS: dict[str, str | None] = {"stages": ".stages"}


@pytest.fixture(autouse=True)
def simple_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.batch.result_digest", digest)
    monkeypatch.setattr("vdet.batch.load_detector", lambda _: None)


def digest(run: Run) -> str:
    state = run.source.stat()
    return f"{state.st_size} {state.st_mtime_ns}"


@pytest.fixture
def clips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("a.mp4", "b.MKV", "c.avi", "day/a.mp4"):
        path = tmp_path / "clips" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"clip")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "clips"


def endings(*wanted: tuple[str, str | None]) -> tuple[Output, ...]:
    return tuple(Output(sink, Path(ending or "")) for sink, ending in wanted)


def plan(
    *inputs: str,
    suffixes: Mapping[str, str | None] = VIDEO,
    folder: str = "out",
    overwrite: bool = False,
    skip_existing: bool = False,
) -> Plan:
    return make_plan(
        [Path(path) for path in inputs],
        Path(folder),
        replace(COMMON, overwrite=overwrite, outputs=endings(*suffixes.items())),
        skip_existing=skip_existing,
    )


def outputs(runs: tuple[Run, ...]) -> list[list[str]]:
    return [[str(output.path) for output in job.outputs] for job in runs]


def record(source: str, *paths: str) -> None:
    """Write outputs, and what the manifest says about them."""
    Path("out").mkdir(exist_ok=True)
    for path in paths:
        Path(path).write_bytes(b"result")
    note(source, *(Output("video", Path(path)) for path in paths))


def note(source: str, *outputs: Output, made_by: str = "") -> None:
    """Add a record of outputs to the manifest."""
    made = ManifestRecord(
        source,
        "now",
        outputs=tuple(
            Written(
                output.sink,
                str(output.path.absolute()),
                size,
                changed,
                digest=made_by or digest(Run(Path(source))),
            )
            for output in outputs
            for size, changed in [output_state(output) or (0, 0)]
        ),
    )
    with open_manifest(Path("out")) as add:
        add(made)


@pytest.mark.usefixtures("clips")
class TestJobs:
    def test_outputs_mirror_inputs_as_mp4(self) -> None:
        made = plan("clips")
        assert [str(job.source) for job in made.runs] == [
            *("clips/a.mp4", "clips/b.MKV", "clips/c.avi", "clips/day/a.mp4")
        ]
        assert outputs(made.runs) == [
            ["out/a.mp4"],
            ["out/b.mp4"],
            ["out/c.mp4"],
            ["out/day/a.mp4"],
        ]
        assert not Path("out").exists()

    def test_a_sink_may_write_several_outputs_of_each_video(self) -> None:
        tracks = endings(*(("tracks", end) for end in (".txt", ".csv", ".coco.json")))
        plan = make_plan([Path("clips/a.mp4")], Path("out"), replace(COMMON, outputs=tracks))
        assert outputs(plan.runs) == [["out/a.txt", "out/a.csv", "out/a.coco.json"]]

    def test_jobs_whose_outputs_are_all_there_and_up_to_date_are_skipped(self) -> None:
        record("clips/a.mp4", "out/a.mp4", "out/a.csv")
        record("clips/b.MKV", "out/b.mp4")
        made = plan("clips", suffixes=VIDEO | TRACKS, skip_existing=True)
        assert [job.source.name for job in made.skipped] == ["a.mp4"]
        assert [(str(job.source), job.overwrite) for job in made.runs] == [
            ("clips/b.MKV", True),
            ("clips/c.avi", False),
            ("clips/day/a.mp4", False),
        ]

    def test_no_run_is_compared_with_the_others(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A plan of 10,000 videos would take minutes."""
        monkeypatch.setattr(Run, "__eq__", lambda *_: pytest.fail("compared"))
        assert len(plan("clips", skip_existing=True).runs) == 4

    @pytest.mark.parametrize(
        "change",
        [
            lambda: Path("out/a.csv").write_bytes(b""),
            lambda: Path("out/a.csv").unlink(),
            lambda: Path("clips/a.mp4").write_bytes(b"longer clip"),
            lambda: os.utime("clips/a.mp4", (0, 0)),
            lambda: note("clips/a.mp4", Output("tracks", Path("out/a.csv")), made_by="other"),
        ],
    )
    def test_what_is_empty_or_out_of_date_is_done_again(self, change: Callable[[], object]) -> None:
        record("clips/a.mp4", "out/a.csv")
        assert plan("clips/a.mp4", suffixes=TRACKS, skip_existing=True).skipped
        change()
        (job,) = plan("clips/a.mp4", suffixes=TRACKS, skip_existing=True).runs
        assert job.overwrite == Path("out/a.csv").exists()

    @pytest.mark.parametrize(
        "change",
        [
            lambda: Path("out/a.csv").write_bytes(b"corrected by hand"),
            lambda: os.utime("out/a.csv", (0, 0)),
            lambda: Path("out/manifest.jsonl").unlink(),
            lambda: Path("out/manifest.jsonl").write_text('"junk"\n{"sizes": 1}\n[[[\n'),
        ],
    )
    def test_what_vdet_did_not_write_is_not_replaced(self, change: Callable[[], object]) -> None:
        record("clips/a.mp4", "out/a.csv")
        change()
        os.utime("clips/a.mp4", (0, 0))
        with pytest.raises(BatchError, match=r"^out/a\.csv: has changed since vdet wrote it"):
            plan("clips/a.mp4", suffixes=TRACKS, skip_existing=True)

    def test_names_that_are_no_utf_8_are_up_to_date_too(self) -> None:
        Path("clips/a.mp4").rename("clips/\udcff.mp4")
        record("clips/\udcff.mp4", "out/\udcff.mp4")
        assert plan("clips/\udcff.mp4", skip_existing=True).skipped


@pytest.mark.usefixtures("clips")
class TestRefused:
    @pytest.mark.parametrize(
        ("inputs", "folder", "words"),
        [
            ("clips/a.mp4 clips/day/a.mp4", "out", "^clips/a.mp4 and clips/day/a.mp4: both would"),
            ("clips/day/a.mp4", "clips/day", "^clips/day/a.mp4: is inside the output folder"),
            *(("clips", folder, "is inside the input") for folder in ("clips", "clips/day")),
            ("clips", ".", "is inside the output folder"),
        ],
    )
    def test_names_that_clash(self, inputs: str, folder: str, words: str) -> None:
        with pytest.raises(BatchError, match=words):
            plan(*inputs.split(), folder=folder)

    def test_tracks_that_would_be_the_manifest(self) -> None:
        Path("clips/a.mp4").rename("clips/manifest.mp4")
        assert len(plan("clips").runs) == 4
        with pytest.raises(BatchError, match=r"^the manifest and clips/manifest\.mp4: both would"):
            plan("clips", suffixes=VIDEO | {"tracks": ".jsonl"})

    def test_an_output_that_is_an_input(self) -> None:
        Path("out").mkdir()
        Path("out/a.mp4").symlink_to(Path("clips/a.mp4").absolute())
        with pytest.raises(OutputError, match=r"out/a\.mp4: is an input of this run"):
            plan("clips", overwrite=True)

    def test_a_manifest_that_is_no_ordinary_file(self) -> None:
        Path("out").mkdir()
        os.mkfifo("out/manifest.jsonl")
        with pytest.raises(OutputError, match=r"manifest\.jsonl: is not a regular file"):
            plan("clips", skip_existing=True)


@pytest.mark.usefixtures("clips")
class TestTotals:
    """A sink with a total: a file over all videos."""

    @pytest.fixture(autouse=True)
    def all_tracks(self, monkeypatch: pytest.MonkeyPatch) -> None:
        total = BatchTotal("all", lambda _, target: target.touch())
        kind = replace(data.tracks, total=total)
        monkeypatch.setattr(data, "tracks", kind)

    def test_it_is_kept_like_other_outputs(self) -> None:
        Path("out").mkdir()
        Path("out/all.csv").write_text("precious")
        with pytest.raises(OutputError, match=r"out/all.csv: already exists"):
            plan("clips/a.mp4", suffixes=TRACKS)
        plan("clips/a.mp4", suffixes=TRACKS, overwrite=True)
        with pytest.raises(OutputError, match=r"out/all.csv: already exists"):
            plan("clips/a.mp4", suffixes=TRACKS, skip_existing=True)
        Path("out/manifest.jsonl").touch()
        plan("clips/a.mp4", suffixes=TRACKS, skip_existing=True)

    def test_a_video_must_not_have_its_name(self) -> None:
        Path("clips/all.mp4").write_bytes(b"clip")
        with pytest.raises(
            BatchError, match=r"clips/all\.mp4: both would be written to out/all\.csv"
        ):
            plan("clips", suffixes=TRACKS)


@pytest.mark.usefixtures("clips")
class TestFolders:
    """An output may be a folder: that of each video has its name too."""

    def record(self) -> None:
        """Write the pictures of a.mp4 and what the manifest says about them."""
        folder = Path("out/a.stages")
        folder.mkdir(parents=True, exist_ok=True)
        for name in ("1-boxes.png", "2-boxes.png"):
            (folder / name).write_bytes(b"picture")
        note("clips/a.mp4", Output("stages", folder))

    def test_one_that_is_there_is_refused_or_replaced_unless_it_is_empty(self) -> None:
        Path("out/a.stages").mkdir(parents=True)
        assert plan("clips/a.mp4", suffixes=FOLDERS).runs
        self.record()
        with pytest.raises(OutputError, match=r"out/a\.stages/1-boxes\.png: already exists"):
            plan("clips/a.mp4", suffixes=FOLDERS)
        assert plan("clips/a.mp4", suffixes=FOLDERS, overwrite=True).runs

    def test_one_is_skipped_kept_or_made_again_by_what_the_sink_writes(self) -> None:
        self.record()
        Path("out/a.stages/notes.txt").write_text("mine")
        assert plan("clips/a.mp4", suffixes=FOLDERS, skip_existing=True).skipped
        Path("out/a.stages/3-boxes.png").write_bytes(b"picture")
        with pytest.raises(BatchError, match=r"out/a\.stages: has changed since vdet wrote it"):
            plan("clips/a.mp4", suffixes=FOLDERS, skip_existing=True)
        Path("out/a.stages").rename("elsewhere")
        assert not plan("clips/a.mp4", suffixes=FOLDERS, skip_existing=True).runs[0].overwrite


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as a camera leaves it; it is the current folder."""
    for name in (
        "clips/b.mp4", "clips/b.vdet.mp4", "clips/a.MOV", "clips/a.srt", "clips/._a.MOV",
        "clips/.trash/old.mp4", "clips/day1/c.avi", "clips/day1/evening/d.ts", "clips/day2/c.avi",
        "clips/notes.txt", "odd [1].mp4", "camera.raw",
    ):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def found(*clips: str) -> list[tuple[str, str]]:
    sources = find_sources([Path(clip) for clip in clips])
    return [(str(source.path), str(source.relative_path)) for source in sources]


VIDEOS = ["a.MOV", "b.mp4", "day1/c.avi", "day1/evening/d.ts", "day2/c.avi"]


@pytest.mark.usefixtures("folder")
class TestFound:
    @pytest.mark.parametrize(
        ("clips", "expected"),
        [
            (["clips/day1/c.avi", "camera.raw"], ["c.avi", "camera.raw"]),  # whatever the suffix
            (["clips"], VIDEOS),  # no hidden or drawn ones
            (["clips", "clips/b.mp4", "link/b.mp4", "clips/../clips"], VIDEOS),  # once
            (["odd [1].mp4"], ["odd [1].mp4"]),  # no pattern
        ],
    )
    def test_a_file_is_taken_and_the_videos_in_a_folder_and_below(
        self, clips: list[str], expected: list[str]
    ) -> None:
        Path("link").symlink_to("clips")
        assert [place for _, place in found(*clips)] == expected

    def test_clips_that_vdet_cut_are_taken_by_name_only(self) -> None:
        for folder in ("mine", "theirs"):
            Path(folder).mkdir()
        name = "clip-00-00-01-car-1.mp4"
        write_drive(Path("mine") / name, 2)
        write_clip(Path("theirs") / name, count=2)
        taken = [(f"{folder}/{name}", name) for folder in ("theirs", "mine")]
        assert found("theirs", f"mine/{name}") == taken
        with pytest.raises(BatchError, match="mine: no video found"):
            found("mine")


def pictures(folder: Path, *numbers: int) -> Path:
    folder.mkdir(parents=True)
    for number in numbers:
        (folder / f"{number:010d}.png").touch()
    return folder


@pytest.mark.usefixtures("folder")
class TestPictures:
    @pytest.mark.parametrize("name", ["frames", "frames.v2"])
    def test_a_folder_of_numbered_pictures_is_a_video_with_its_name(self, name: str) -> None:
        folder = pictures(Path(name), 7, 8, 9)
        assert found(name) == [(name, f"{name}.png")]
        os.chdir(folder)
        assert found(".") == [(".", f"{name}.png")]

    def test_pictures_of_several_kinds_are_left_out_with_a_warning(
        self, caplog: pytest.LogCaptureFixture
    ) -> None:
        (pictures(Path("drives/one"), 0, 2, 3) / "front_0.png").touch()
        pictures(Path("drives/two"), 0, 1)
        assert [place for _, place in found("drives")] == ["two.png"]
        assert "drives/one: has several kinds of names" in caplog.text

    def test_a_pattern_of_numbered_pictures_is_a_video_with_the_name_of_the_folder(self) -> None:
        pictures(Path("frames"), 3, 4)
        assert found("frames/%010d.png") == [("frames/%010d.png", "frames.png")]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("clip", "words"),
    [
        ("none.mp4", "none.mp4: no video found"),
        ("none/", "none: no video found"),
        ("empty", "empty: no video found"),
        ("*.mkv", r"\*.mkv: no video found"),
    ],
)
def test_a_clip_that_gives_no_video_is_named(clip: str, words: str) -> None:
    with pytest.raises(BatchError, match=f"^{words}"):
        find_sources([Path("clips"), Path(clip)])


def test_a_folder_that_cannot_be_read_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = os.scandir

    def deny(path: str) -> object:
        if Path(path).name == "day1":
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr("os.scandir", deny)
    with pytest.raises(BatchError, match=r"day1: cannot be read: Permission denied; remove it$"):
        find_sources([folder / "clips"])
