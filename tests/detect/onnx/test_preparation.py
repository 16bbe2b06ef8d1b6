"""What a network sees of a frame: its place in the input, from BGR and from planes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from codings import in_any_coding
from vdet.boxes import Float64Array
from vdet.detect.onnx.network import InputForm
from vdet.media import Picture, Planes
from vdet.media.frame import Coding
from vdet.synthetic import Renderer, demo_scene

ROAD = Renderer(demo_scene(1, width=1280, height=720)).image(200)
FORMS = pytest.mark.parametrize("dtype", [np.uint8, np.float32], ids=["ours", "others"])
Dtype = type[np.generic]
Measure = Callable[[Float64Array], np.floating[Any]]


def road(coding: Coding) -> Picture:
    return Picture(Planes.of_image(ROAD, coding))


def seen(form: InputForm, picture: Picture) -> Float64Array:
    """Return what a network sees: `(3, height, width)`, BGR from 0 to 255."""
    values = form.prepare(picture)
    assert values.dtype == form.dtype
    if form.dtype is np.uint8:
        return np.asarray(values[0].transpose(2, 0, 1), np.float64)
    return np.asarray(255 * values[0, ::-1], np.float64)


def of_channels(values: Float64Array, measure: Measure = np.mean) -> Float64Array:
    """Return the mean, or another measure, of each channel of an input."""
    return np.array([measure(channel) for channel in values])


@in_any_coding
@FORMS
@pytest.mark.parametrize(
    ("width", "height"),
    [(96, 64), (160, 160), (416, 320), (95, 64), (96, 63), (95, 63)],
    ids=["smaller", "square", "larger", "odd width", "odd height", "odd"],
)
def test_planes_look_like_the_same_picture_as_bgr(
    dtype: Dtype, width: int, height: int, coding: Coding
) -> None:
    picture, form = road(coding), InputForm(width, height, dtype)
    ours, expected = seen(form, picture), seen(form, Picture(picture.image))
    apart = np.abs(ours - expected)
    assert of_channels(apart).max() < 0.9
    assert np.percentile(apart, 99) <= 3
    assert np.abs(of_channels(ours - expected)).max() < 0.65
    assert of_channels(expected, np.std).min() > 20


@in_any_coding
@pytest.mark.parametrize("size", [(96, 64), (95, 63), (1280, 720), (1500, 900)])
def test_planes_are_scaled_before_they_are_converted(
    size: tuple[int, int], coding: Coding, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Picture, "image", property(pytest.fail))
    InputForm(*size).prepare(road(coding))


@pytest.mark.parametrize("picture", [Picture(ROAD), road(Coding())], ids=["BGR", "planes"])
@FORMS
def test_only_the_letterbox_of_other_networks_is_grey_beyond_the_frame(
    dtype: Dtype, picture: Picture
) -> None:
    form = InputForm(96, 96, dtype)
    values = seen(form, picture)
    top, height = (0, 96) if dtype is np.uint8 else (21, 54)
    frame = np.array([[0, top, 96, top + height]], np.float32)
    assert form.to_frame(frame, picture) == pytest.approx(np.array([[0, 0, 1280, 720]]))
    is_frame = np.isin(np.arange(96), np.arange(top, top + height))
    assert values[:, ~is_frame] == pytest.approx(114)
    assert (values[:, is_frame].round() != 114).any(axis=(0, 2)).all()
