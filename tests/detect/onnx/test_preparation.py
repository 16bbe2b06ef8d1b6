"""What a network sees of a frame: its place in the input, from BGR and from planes."""

from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest

from codings import in_any_coding
from vdet.boxes import Float64Array
from vdet.detect.onnx.preparation import Fit, InputForm
from vdet.media import Picture, Planes
from vdet.media.frame import Coding
from vdet.synthetic.random_scenes import demo_scene
from vdet.synthetic.render import render

ROAD = render(demo_scene(1, width=1280, height=720), 200)
FITS = get_args(Fit)
Measure = Callable[[Float64Array], np.floating[Any]]


def road(coding: Coding) -> Picture:
    return Picture(Planes.of_image(ROAD, coding))


def inputs(form: InputForm, picture: Picture) -> tuple[Float64Array, ...]:
    """Return what a network sees of planes, and of the same picture as BGR."""
    (ours, place), (expected, place_of_bgr) = (
        form.prepare(item) for item in (picture, Picture(picture.image))
    )
    assert place == place_of_bgr
    assert ours.shape == expected.shape
    assert ours.dtype == expected.dtype
    return ours.astype(np.float64), expected.astype(np.float64)


def of_channels(values: Float64Array, measure: Measure = np.mean) -> Float64Array:
    """Return the mean, or another measure, of each channel of an input."""
    return np.array([measure(channel) for channel in values[0]])


@in_any_coding
@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize(
    ("width", "height"),
    [(96, 64), (160, 160), (416, 320), (95, 64), (96, 63), (95, 63)],
    ids=["smaller", "square", "larger", "odd width", "odd height", "odd"],
)
@pytest.mark.parametrize("is_rgb", [False, True], ids=["BGR", "RGB"])
def test_planes_look_like_the_same_picture_as_bgr(
    fit: Fit, width: int, height: int, is_rgb: bool, coding: Coding
) -> None:
    ours, expected = inputs(InputForm(width, height, fit, is_rgb=is_rgb), road(coding))
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
@pytest.mark.parametrize(
    ("fit", "rows"), [("stretch", slice(0, 96)), ("center", slice(21, 75)), ("corner", slice(54))]
)
def test_beyond_the_frame_the_input_is_grey(picture: Picture, fit: Fit, rows: slice) -> None:
    values, place = InputForm(96, 96, fit).prepare(picture)
    assert (place.left, place.top, *place.size) == (0, rows.start or 0, 96, rows.stop - place.top)
    inside = np.zeros(96, bool)
    inside[rows] = True
    assert (values[:, :, ~inside] == 114).all()
    assert (values[:, :, inside] != 114).any(axis=(0, 1, 3)).all()


def test_planes_are_not_changed() -> None:
    picture = road(Coding())
    assert picture.planes is not None
    before = [layer.copy() for layer in picture.planes.layers]
    InputForm(1280, 720).prepare(picture)[0][:] = 0
    for layer, expected in zip(picture.planes.layers, before, strict=True):
        np.testing.assert_array_equal(layer, expected)
