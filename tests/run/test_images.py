"""Still pictures: which are taken, where their results go, and what is found in them."""

import json
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

    @pytest.mark.parametrize(
        ("name", "words"),
        [("in", r"in: contains no images \(.*\.png"), ("none.png", r"none\.png: not found")],
    )
    def test_what_has_no_picture_is_named(self, tmp_path: Path, name: str, words: str) -> None:
        touch(tmp_path / "in" / "notes.txt")
        with pytest.raises(ImageError, match=words):
            find_images([tmp_path / name])


def placed(folder: Path, *names: str) -> dict[Path, Path]:
    return {folder / name: Path(name) for name in names}


class TestPlan:
    def test_one_picture_goes_to_the_file_named(self, tmp_path: Path) -> None:
        source, out = tmp_path / "a.png", tmp_path / "found.jpg"
        expected = ImageJob(source, (Output("image", out),), Path("a.png"))
        assert plan_images(placed(tmp_path, "a.png"), out, None, OutputFiles()) == [expected]

    def test_several_keep_their_names_in_the_folder(self, tmp_path: Path) -> None:
        sources = placed(tmp_path, "a.png", "north/a.png")
        jobs = plan_images(sources, tmp_path / "out", None, OutputFiles())
        assert [job.outputs for job in jobs] == [
            (Output("image", tmp_path / "out" / place),) for place in sources.values()
        ]

    def test_stages_of_several_go_into_a_folder_each(self, tmp_path: Path) -> None:
        sources = placed(tmp_path, "a.png", "b.png")
        jobs = plan_images(sources, None, tmp_path / "stages", OutputFiles())
        assert [job.outputs for job in jobs] == [
            (Output("stages", tmp_path / "stages" / name),) for name in "ab"
        ]


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

    def test_a_shared_output_that_fails_at_the_end_leaves_nothing(
        self, jobs: list[ImageJob], tmp_path: Path, register: Register
    ) -> None:
        register("fails", SinkKind(Fails))
        shared = [Output("json", tmp_path / "boxes.json"), Output("fails", tmp_path / "fails.txt")]
        with pytest.raises(OutputError, match=r"fails\.txt: cannot be written: No space"):
            list(
                run_images(jobs, shared, ImageSearch(model_for(SETTINGS), SETTINGS), OutputFiles())
            )
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

    def test_the_outputs_of_one_picture_appear_together_or_not_at_all(
        self, jobs: list[ImageJob], tmp_path: Path, register: Register
    ) -> None:
        register("fails", SinkKind(Fails))
        (first, *_) = jobs
        fails = Output("fails", tmp_path / "fails.txt")
        for outputs in ((*first.outputs, fails), (fails, *first.outputs)):
            job = replace(first, outputs=outputs)
            with pytest.raises(OutputError, match=r"fails\.txt: cannot be written: No space"):
                list(
                    run_images([job], (), ImageSearch(model_for(SETTINGS), SETTINGS), OutputFiles())
                )
            assert self.names(tmp_path) == []
