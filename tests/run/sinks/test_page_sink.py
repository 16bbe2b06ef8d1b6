"""The sink `page` in a run."""

import json
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from clips import write_clip
from pages.html import Elements
from red_cars import CAR, HEIGHT, SETTINGS, WIDTH, road
from run.red_runs import COUNT, outputs, result_of, run_red, video_info, write
from running import names
from vdet.boxes import Image
from vdet.config.scene import RegionSettings
from vdet.config.schema import OutputSettings
from vdet.media.images import decode_image, read_image
from vdet.pages.render import thumbnail as small_picture
from vdet.run.sinks import Output
from vdet.run.video import Run
from writing import write_image


def page_of(folder: Path) -> Elements:
    return Elements((folder / "page.html").read_text(encoding="utf-8"))


def picture(uri: str | None) -> Image:
    import base64

    image = decode_image(base64.b64decode((uri or "").partition(",")[2]))
    assert image is not None
    return image


def test_a_run_writes_a_page_that_shows_the_video_of_the_run(
    red_clip: Path, tmp_path: Path
) -> None:
    wanted = outputs(video=tmp_path / "out.mp4", page=tmp_path / "page")
    totals = run_red(Run(red_clip, wanted))
    made = page_of(tmp_path / "page")
    (video,) = made.all("video")
    assert video["src"] == "../out.mp4"
    facts = totals.summaries[tmp_path / "page"]
    assert (facts["frames"], facts["vehicles"], facts["max_at_once"]) == (COUNT, 1, 1)
    assert facts["seconds"] == pytest.approx(COUNT / 25)
    (table,) = re.findall('id="vehicles">(.*?)<', (tmp_path / "page" / "page.html").read_text())
    (thumbnail,) = json.loads(table)["picture"]
    assert names(tmp_path / "page") == ["page.html", "vehicle-1.webp"]
    file = tmp_path / "page" / facts["rows"][0]["picture"]
    assert file.stat().st_size <= 2048
    for shown in (picture(thumbnail), read_image(file)):
        blue, _, red = shown.reshape(-1, 3).mean(axis=0)
        assert red > blue + 50
    noise = np.random.default_rng(0).integers(0, 256, (400, 300, 3), np.uint8)
    assert len(small_picture(noise)) <= 2048


def test_without_a_video_of_the_run_it_shows_the_source(red_clip: Path, tmp_path: Path) -> None:
    run_red(Run(red_clip, outputs(page=tmp_path / "page"), start=Fraction(1)))
    made = page_of(tmp_path / "page")
    (video,) = made.all("video")
    target = (tmp_path / "page" / (video["src"] or "")).resolve()
    assert target == red_clip.resolve()
    times = [float(link["data-time"] or "") for link in made.all("a")]
    assert min(times) >= 1, "the source is there from its beginning"


@pytest.mark.parametrize(
    ("name", "codec", "plays"),
    [
        ("img_%04d.png", "", False),
        ("in.avi", "mpeg4", False),
        ("in.ts", "libx264", False),
        ("in.mkv", "libx264", True),
        ("in.mov", "libx264", True),
    ],
)
def test_a_source_that_no_browser_plays_is_no_video_to_show(
    tmp_path: Path, name: str, codec: str, plays: bool
) -> None:
    if codec:
        write_clip(tmp_path / name, codec=codec)
    video = replace(video_info(), path=tmp_path / name)
    write(Output("page", tmp_path / "page"), [result_of(CAR)], video=video)
    assert len(page_of(tmp_path / "page").all("video")) == plays


def test_the_still_is_the_first_frame_that_shows_the_most_vehicles(tmp_path: Path) -> None:
    black, bright = np.zeros_like(road()), np.full_like(road(), 250)
    images = [black, bright, black]
    results = [
        result_of(*[CAR] * min(n, 1), image=image, index=n, time=Fraction(n, 25))
        for n, image in enumerate(images)
    ]
    source = write_clip(tmp_path / "red.mp4")
    write(Output("page", tmp_path / "page"), results, video=replace(video_info(), path=source))
    made = page_of(tmp_path / "page")
    (still,), (video,) = made.all("img", **{"class": "still"}), made.all("video")
    assert picture(still["src"]).mean() > 150
    poster, plain = (picture(uri).astype(int) for uri in (video["poster"], still["src"]))
    differs = np.abs(poster - plain).max(axis=2) > 20
    x1, y1, x2, y2 = CAR.pixels
    assert differs[y1:y2, x1].all(), "the poster has a box around the vehicle"
    differs[y1 - 8 : y2 + 8, x1 - 8 : x2 + 8] = False
    assert not differs.any()


def test_coarse_pages_have_no_readable_faces_or_plates(tmp_path: Path) -> None:
    fine = np.indices((HEIGHT, WIDTH)).sum(axis=0) % 2 * 255  # details of one pixel
    shown = result_of(CAR, image=np.repeat(fine[..., np.newaxis], 3, axis=2).astype(np.uint8))
    output = OutputSettings(coarse=True)
    write(
        Output("page", tmp_path), [shown], settings=SETTINGS.model_copy(update={"output": output})
    )
    (table,) = re.findall('id="vehicles">(.*?)<', (tmp_path / "page.html").read_text())
    (thumbnail,) = json.loads(table)["picture"]
    assert picture(thumbnail).shape == (36, 48, 3)  # 40 pixels, and a tenth around it
    (still,) = page_of(tmp_path).all("img", **{"class": "still"})
    for uri in (thumbnail, still["src"]):
        assert np.median(np.abs(np.diff(picture(uri).astype(int), axis=1))) < 20


def test_the_folders_of_a_mask_are_nobodys_business(red_clip: Path, tmp_path: Path) -> None:
    mask = tmp_path / "secret" / "mask.png"
    mask.parent.mkdir()
    write_image(mask, np.full_like(road(), 255))
    region = RegionSettings(name="road", mask=str(mask))
    settings = SETTINGS.model_copy(update={"regions": (region,)})
    run_red(Run(red_clip, outputs(page=tmp_path / "page")), settings)
    text = page_of(tmp_path / "page").text
    assert "mask: mask.png" in text
    assert "secret" not in text


def test_times_without_frames_are_named(tmp_path: Path) -> None:
    times = (Fraction(0), Fraction(1, 25), Fraction(5), Fraction(126, 25))
    results = [result_of(CAR, index=n, time=time) for n, time in enumerate(times)]
    write(Output("page", tmp_path / "page"), results)
    assert "No frames from 0:00 to 0:05." in page_of(tmp_path / "page").text
