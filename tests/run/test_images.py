"""Still pictures: which are taken, where their results go, and what is found in them."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Self

import pytest

from red_cars import CAR, SETTINGS, road
from run.conftest import Register
from run.red_runs import model_for
from running import names
from vdet.errors import ImageError, OutputError
from vdet.files import OutputFiles
from vdet.run.images import ImageJob, ImageSearch, find_images, plan_images, run_images
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.run.steps import FrameResult
from writing import write_image


def touch(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


class TestFindingImages:
    def test_each_picture_below_a_folder_has_its_place(self, tmp_path: Path) -> None:
        names = ("b.png", "a/b.png", "a.JPG", "c.webp", "notes.txt", ".thumbs/b.png")
        hidden = ("__MACOSX/a/b.png", "a/._b.png", "Thumbs.db", ".DS_Store")
        touch(*(tmp_path / name for name in (*names, *hidden)))
        found = find_images([tmp_path])
        assert list(found) == [tmp_path / name for name in ("a/b.png", "a.JPG", "b.png", "c.webp")]
        assert found == {tmp_path / place: place for place in found.values()}

    def test_a_picture_that_is_named_twice_is_taken_once(self, tmp_path: Path) -> None:
        touch(tmp_path / "a.png", tmp_path / "b.png")
        found = find_images([tmp_path / "b.png", tmp_path, tmp_path / "a.png"])
        assert [path.name for path in found] == ["b.png", "a.png"]


def placed(folder: Path, *names: str) -> dict[Path, Path]:
    return {folder / name: Path(name) for name in names}


@pytest.mark.parametrize(
    ("names", "out", "stages", "paths"),
    [
        (("a.png",), Path("found.jpg"), None, ["image found.jpg"]),
        (("a.png", "north/a.png"), Path("out"), None, ["image out/a.png", "image out/north/a.png"]),
        (("a.png", "b.png"), None, Path("stages"), ["stages stages/a", "stages stages/b"]),
    ],
)
def test_one_picture_goes_to_the_file_named_and_several_below_the_folder(
    names: Sequence[str], out: Path | None, stages: Path | None, paths: Sequence[str]
) -> None:
    sources = placed(Path("in"), *names)
    jobs = plan_images(sources, out, stages, OutputFiles())
    assert [job.source for job in jobs] == list(sources)
    assert [f"{output.sink} {output.path}" for job in jobs for output in job.outputs] == paths


def test_a_picture_that_is_too_small_is_named(tmp_path: Path) -> None:
    source, out = tmp_path / "tiny.png", tmp_path / "out.png"
    write_image(source, road(CAR)[:, :20])
    job = ImageJob(source, (Output("image", out),))
    (found,) = run_images([job], (), ImageSearch(model_for(SETTINGS), SETTINGS), OutputFiles())
    assert isinstance(found, ImageError)
    assert "tiny.png: no search window fits" in str(found)
    assert not out.exists()


class Fails:
    """A sink that stages a file, and fails when its block ends without an error."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self.file = context.files.stage(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            raise OSError(28, "No space left on device")

    def write(self, result: FrameResult) -> None:
        self.file.write_text(result.source.name)


class TestSeveral:
    @pytest.fixture
    def jobs(self, tmp_path: Path) -> list[ImageJob]:
        """Two pictures of a car, and between them a file that is not a picture."""
        jobs = []
        for name in ("a.png", "b.png", "c.png"):
            source = tmp_path / name
            write_image(source, road(CAR))
            jobs.append(ImageJob(source, (Output("image", tmp_path / f"out-{name}"),)))
        (tmp_path / "b.png").write_text("no picture")
        return jobs

    def names(self, folder: Path) -> list[str]:
        return sorted(path.name for path in folder.iterdir() if len(path.stem) > 1)

    @pytest.mark.parametrize("threads", [1, 3])
    def test_a_picture_that_cannot_be_read_does_not_stop_the_others(
        self, jobs: list[ImageJob], tmp_path: Path, threads: int
    ) -> None:
        shared = [Output("json", tmp_path / "boxes.json")]
        search = ImageSearch(model_for(SETTINGS), SETTINGS)
        first, failure, last = run_images(jobs, shared, search, OutputFiles(), threads=threads)
        assert isinstance(first, FrameResult)
        assert isinstance(last, FrameResult)
        assert "b.png: is not an image" in str(failure)
        assert self.names(tmp_path) == ["boxes.json", "out-a.png", "out-c.png"]
        items = json.loads((tmp_path / "boxes.json").read_text())
        assert [Path(item["image"]).name for item in items] == ["a.png", "c.png"]
        assert [len(item["boxes"]) for item in items] == [1, 1]

    @pytest.mark.parametrize(
        ("own", "shared"),
        [(("image", "fails"), ()), (("fails", "image"), ()), (("image",), ("json", "fails"))],
    )
    def test_after_an_output_that_fails_at_the_end_none_appears(
        self,
        jobs: list[ImageJob],
        tmp_path: Path,
        register: Register,
        own: Sequence[str],
        shared: Sequence[str],
    ) -> None:
        register("fails", SinkKind(Fails))
        names = {"image": "out.png", "fails": "fails.txt", "json": "boxes.json"}
        outputs = {sink: Output(sink, tmp_path / name) for sink, name in names.items()}
        first = replace(jobs[0], outputs=tuple(outputs[sink] for sink in own))
        given = [first, jobs[2]] if shared else [first]
        search = ImageSearch(model_for(SETTINGS), SETTINGS)
        results = run_images(given, [outputs[sink] for sink in shared], search, OutputFiles())
        with pytest.raises(OutputError, match=r"fails\.txt: cannot be written: No space"):
            list(results)
        assert self.names(tmp_path) == []

    @pytest.mark.usefixtures("jobs")
    @pytest.mark.parametrize("is_stopped", [False, True])
    def test_a_run_that_ends_early_or_clashes_leaves_no_picture(
        self, tmp_path: Path, is_stopped: bool
    ) -> None:
        sources = placed(tmp_path, "a.png", "c.png")
        plan = plan_images(sources, tmp_path / "out", tmp_path / "stages", OutputFiles())
        results = run_images(plan, (), ImageSearch(model_for(SETTINGS), SETTINGS), OutputFiles())
        next(results)
        assert not list(tmp_path.rglob("out/[a-z]*"))
        if is_stopped:
            results.close()
            assert not (tmp_path / "out").exists()
            assert not (tmp_path / "stages").exists()
        else:
            (tmp_path / "out").mkdir()
            (tmp_path / "out" / "c.png").write_text("of another program")
            with pytest.raises(OutputError, match=r"c\.png: appeared during the run"):
                list(results)
            assert names(tmp_path / "out") == ["c.png"]
            assert not (tmp_path / "stages").exists()
