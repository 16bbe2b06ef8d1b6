import json
from pathlib import Path

import numpy as np
import pytest

from red_cars import CAR, HEIGHT, PERSPECTIVE, SETTINGS, WIDTH, red_finder, road
from vdet.config.schema import Settings
from vdet.detect.svm.detector import detect_still, still_boxes
from vdet.errors import ImageError, OutputError
from vdet.files import write_json
from vdet.geometry import Box
from vdet.media.images import read_image, write_image
from vdet.pipeline.pictures import (
    PictureJob,
    StillResult,
    find_images,
    list_results,
    plan,
    run_picture,
)


def touch(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


class TestFindingImages:
    def test_files_stay_in_the_order_given(self, tmp_path: Path) -> None:
        paths = [tmp_path / name for name in ("b.png", "a.jpg", "c.txt")]
        touch(*paths)
        assert find_images(paths) == paths

    def test_a_folder_gives_its_pictures_by_name(self, tmp_path: Path) -> None:
        touch(*(tmp_path / name for name in ("b.png", "a.JPG", "c.webp", "notes.txt")))
        assert [path.name for path in find_images([tmp_path])] == ["a.JPG", "b.png", "c.webp"]

    def test_folders_inside_a_folder_are_not_searched(self, tmp_path: Path) -> None:
        touch(tmp_path / "a.png", tmp_path / "more" / "b.png")
        assert find_images([tmp_path]) == [tmp_path / "a.png"]

    def test_a_picture_that_is_named_twice_is_taken_once(self, tmp_path: Path) -> None:
        touch(tmp_path / "a.png", tmp_path / "b.png")
        found = find_images([tmp_path / "b.png", tmp_path, tmp_path / "a.png"])
        assert [path.name for path in found] == ["b.png", "a.png"]

    def test_a_folder_without_pictures_is_named(self, tmp_path: Path) -> None:
        touch(tmp_path / "in" / "notes.txt")
        with pytest.raises(ImageError, match=r"in: holds no pictures \(.*\.png"):
            find_images([tmp_path / "in"])

    def test_what_is_not_there_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(ImageError, match=r"none\.png: no such file or folder"):
            find_images([tmp_path / "none.png"])


class TestPlan:
    def test_one_picture_goes_to_the_file_named(self, tmp_path: Path) -> None:
        source, out = tmp_path / "a.png", tmp_path / "found.jpg"
        assert plan([source], out, None, overwrite=False) == [PictureJob(source, out, None)]

    def test_one_picture_goes_into_a_folder_that_is_named(self, tmp_path: Path) -> None:
        out = tmp_path / "new" / "out"
        (job,) = plan([tmp_path / "a.png"], out, None, overwrite=False)
        assert job.picture == out / "a.png"
        assert out.is_dir()

    def test_several_keep_their_names_in_the_folder(self, tmp_path: Path) -> None:
        sources = [tmp_path / "a.png", tmp_path / "b.jpg"]
        jobs = plan(sources, tmp_path / "out", None, overwrite=False)
        assert [job.picture for job in jobs] == [tmp_path / "out" / s.name for s in sources]

    def test_without_an_output_no_picture_is_written(self, tmp_path: Path) -> None:
        (job,) = plan([tmp_path / "a.png"], None, tmp_path / "stages", overwrite=False)
        assert job.picture is None
        assert [path.name for path in tmp_path.iterdir()] == ["stages"]

    def test_stages_of_two_inputs_of_one_stem_are_refused(self, tmp_path: Path) -> None:
        sources = [tmp_path / "a.png", tmp_path / "a.jpg"]
        with pytest.raises(OutputError, match="wanted by two inputs"):
            plan(sources, None, tmp_path / "stages", overwrite=False)

    def test_earlier_stages_are_kept(self, tmp_path: Path) -> None:
        (tmp_path / "5-boxes.png").write_text("precious")
        with pytest.raises(OutputError, match="--overwrite"):
            plan([tmp_path / "a.png"], None, tmp_path, overwrite=False)

    def test_stages_of_one_picture_go_into_the_folder_itself(self, tmp_path: Path) -> None:
        (job,) = plan([tmp_path / "a.png"], None, tmp_path / "stages", overwrite=False)
        assert job.stages == tmp_path / "stages"

    def test_stages_of_several_go_into_a_folder_each(self, tmp_path: Path) -> None:
        sources = [tmp_path / "a.png", tmp_path / "b.png"]
        jobs = plan(sources, None, tmp_path / "stages", overwrite=False)
        assert [job.stages for job in jobs] == [tmp_path / "stages" / name for name in "ab"]

    def test_one_output_that_is_there_already_refuses_all(self, tmp_path: Path) -> None:
        sources = [tmp_path / "a.png", tmp_path / "b.png"]
        touch(tmp_path / "out" / "b.png")
        with pytest.raises(OutputError, match=r"b\.png: is there already"):
            plan(sources, tmp_path / "out", None, overwrite=False)
        assert len(plan(sources, tmp_path / "out", None, overwrite=True)) == 2

    def test_a_file_where_the_folder_should_be_is_refused(self, tmp_path: Path) -> None:
        touch(tmp_path / "out")
        with pytest.raises(OutputError, match="out: cannot be made a folder"):
            plan([tmp_path / "a.png", tmp_path / "b.png"], tmp_path / "out", None, overwrite=True)

    def test_the_folder_of_the_inputs_cannot_be_the_output(self, tmp_path: Path) -> None:
        touch(tmp_path / "a.png", tmp_path / "b.png")
        with pytest.raises(OutputError, match="is the input itself"):
            plan([tmp_path / "a.png", tmp_path / "b.png"], tmp_path, None, overwrite=True)


class TestProcessing:
    @pytest.fixture
    def source(self, tmp_path: Path) -> Path:
        path = tmp_path / "road.png"
        write_image(path, road(CAR))
        return path

    @pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["original", "default"])
    def test_gives_the_boxes_of_the_detection(self, source: Path, settings: Settings) -> None:
        result = run_picture(PictureJob(source, None, None), red_finder(), settings)
        detection = detect_still(red_finder(), settings, road(CAR))
        assert result == StillResult(
            source, WIDTH, HEIGHT, tuple(still_boxes(detection, settings, WIDTH, HEIGHT))
        )
        ((box, peak),) = result.boxes
        assert box.iou(CAR) > 0.35
        assert peak > settings.heat.threshold

    def test_writes_nothing_that_is_not_asked_for(self, source: Path) -> None:
        run_picture(PictureJob(source, None, None), red_finder(), SETTINGS)
        assert [path.name for path in source.parent.iterdir()] == ["road.png"]

    def test_draws_the_boxes_into_the_picture_only(self, source: Path) -> None:
        out = source.with_name("out.png")
        result = run_picture(PictureJob(source, out, None), red_finder(), SETTINGS)
        ((box, _),) = result.boxes
        changed = (read_image(out) != road(CAR)).any(axis=2)
        assert changed[box.y : box.bottom, box.x].all()
        assert not changed[box.bottom :].any()
        np.testing.assert_array_equal(read_image(source), road(CAR))

    def test_an_empty_road_is_written_as_it_is(self, tmp_path: Path) -> None:
        source, out = tmp_path / "empty.png", tmp_path / "out.png"
        write_image(source, road())
        result = run_picture(PictureJob(source, out, None), red_finder(), SETTINGS)
        assert result.boxes == ()
        np.testing.assert_array_equal(read_image(out), road())

    def test_stages_show_the_frame_without_the_boxes_of_the_output(self, source: Path) -> None:
        job = PictureJob(source, source.with_name("out.png"), source.with_name("stages"))
        run_picture(job, red_finder(), SETTINGS)
        assert len(list(source.with_name("stages").iterdir())) == 5

    def test_a_picture_that_is_too_small_is_named(self, tmp_path: Path) -> None:
        source = tmp_path / "tiny.png"
        write_image(source, road(CAR)[:, :20])
        with pytest.raises(ImageError, match=r"tiny\.png: no search window fits"):
            run_picture(PictureJob(source, tmp_path / "out.png", None), red_finder(), SETTINGS)
        assert not (tmp_path / "out.png").exists()


class TestJson:
    RESULTS = (
        StillResult(Path("a.png"), 320, 240, ((Box(1, 2, 3, 4), 5.67891),)),
        StillResult(Path("in") / "b.png", 64, 48, ()),
    )
    ITEMS = (
        {
            "image": "a.png",
            "width": 320,
            "height": 240,
            "boxes": [{"x": 1, "y": 2, "width": 3, "height": 4, "peak": 5.679}],
        },
        {"image": str(Path("in") / "b.png"), "width": 64, "height": 48, "boxes": []},
    )

    def test_has_an_item_a_picture_with_a_list_of_boxes(self, tmp_path: Path) -> None:
        path = tmp_path / "boxes.json"
        write_json(list_results(self.RESULTS), str(path))
        assert json.loads(path.read_text(encoding="utf-8")) == list(self.ITEMS)

    def test_a_dash_is_standard_output(self, capsys: pytest.CaptureFixture[str]) -> None:
        write_json(list_results(self.RESULTS), "-")
        assert json.loads(capsys.readouterr().out) == list(self.ITEMS)

    def test_of_no_pictures_is_an_empty_list(self, tmp_path: Path) -> None:
        write_json(list_results([]), str(tmp_path / "boxes.json"))
        assert json.loads((tmp_path / "boxes.json").read_text()) == []

    def test_a_file_that_cannot_be_written_is_named(self, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match=r"boxes\.json: cannot be written"):
            write_json(list_results(self.RESULTS), str(tmp_path / "none" / "boxes.json"))
