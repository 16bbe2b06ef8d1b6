"""What a written video keeps of its source: sound, times, the upright picture."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from clips import sound_of, write_clip
from red_cars import HEIGHT, SETTINGS, WIDTH, drive
from run.red_runs import outputs, read, run_red, video_info
from vdet.config.schema import OutputSettings
from vdet.media import ColorTags, Picture
from vdet.media.frame import UNSPECIFIED, Coding, Planes
from vdet.media.writer import VideoWriter
from vdet.run.video import Run

TONE_RATE = 48_000


CODINGS = {
    "untagged": (Coding(), UNSPECIFIED),
    "BT.601": (Coding(), 6),
    "BT.709": (Coding("bt709"), 1),
    "full range": (Coding(full_range=True), UNSPECIFIED),
    "BT.601, full range": (Coding(full_range=True), 6),
    "BT.709, full range": (Coding("bt709", full_range=True), 1),
}
"""How the source is coded, and the tag of its matrix."""
FRAMES = 30
LABEL = 30
"""Pixels above a box that its label may need."""


@pytest.fixture(scope="module", params=CODINGS)
def filmed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A red car on a road with noise, which no encoder leaves as it is."""
    coding, matrix = CODINGS[request.param]
    path = tmp_path_factory.mktemp("filmed") / "in.mp4"
    info = replace(video_info(), color=ColorTags(matrix=matrix), coding=coding)
    noise = np.random.default_rng(0).integers(0, 40, (FRAMES, HEIGHT, WIDTH, 3), np.uint8)
    with VideoWriter(path, info, OutputSettings(crf=15)) as writer:
        for frame in drive(FRAMES):
            grainy = np.where(frame.image > 200, frame.image, frame.image + noise[frame.index])
            writer.write(replace(frame, picture=Picture(grainy.astype(np.uint8))))
    return path


def planes_of(path: Path) -> list[Planes]:
    """Return what the decoder gives."""
    found = [frame.picture.planes for frame in read(path)]
    planes = [item for item in found if item is not None]
    assert len(planes) == len(found) == FRAMES
    return planes


def untouched(track_file: Path) -> list[NDArray[np.bool_]]:
    """Tell for each frame, by value of chroma, what lies away from the outlines and labels."""
    masks = []
    for line in track_file.read_text().splitlines():
        mask = np.ones((HEIGHT // 2, WIDTH // 2), bool)
        for track in json.loads(line)["tracks"]:
            x, y, width, height = (track[key] for key in ("x", "y", "width", "height"))
            left, right, top, bottom = x - 4, x + max(width, 40) + 4, y - LABEL, y + height + 4
            mask[max(0, top // 2) : bottom // 2 + 1, max(0, left // 2) : right // 2 + 1] = False
            inner = np.s_[y // 2 + 4 : (y + height) // 2 - 4, x // 2 + 4 : (x + width) // 2 - 4]
            mask[inner] = True
        masks.append(mask)
    return masks


def test_without_loss_in_the_encoder_pixels_not_drawn_on_are_those_of_the_source(
    filmed: Path, tmp_path: Path
) -> None:
    """Far from boxes and labels, and inside boxes: luma and chroma are equal, bit for bit."""
    wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.jsonl")
    lossless = OutputSettings(preset="ultrafast", crf=0)
    run_red(Run(filmed, wanted), SETTINGS.model_copy(update={"output": lossless}))
    pairs = zip(planes_of(filmed), planes_of(tmp_path / "out.mp4"), strict=True)
    drawn = 0
    for mask, (before, after) in zip(untouched(tmp_path / "out.jsonl"), pairs, strict=True):
        changed = after.luma != before.luma
        assert not (changed & mask.repeat(2, axis=0).repeat(2, axis=1)).any()
        for old, new in ((before.blue, after.blue), (before.red, after.red)):
            assert not ((new != old) & mask).any()
        if not mask.all():
            assert changed.any()
            drawn += 1
    assert drawn > FRAMES // 2, "there are boxes"


def test_a_part_has_the_sound_of_that_part(tmp_path: Path) -> None:
    times = [Fraction(n, 25) + Fraction(n * n, 9000) for n in range(40)]
    source = write_clip(tmp_path / "in.mp4", times=times, sounds=["aac"])
    begin, end = [frame.time for frame in read(source)][10:30:19]
    run_red(Run(source, outputs(video=tmp_path / "out.mp4"), start=begin, end=end))
    after = sound_of(tmp_path / "out.mp4")
    assert len(after) == pytest.approx(float(end - begin) * TONE_RATE / 1024, abs=2)
    moments = {data: time - float(begin) for time, data in sound_of(source)}
    expected = [moments[data] for _, data in after]
    assert [time for time, _ in after] == pytest.approx(expected, abs=0.001)
