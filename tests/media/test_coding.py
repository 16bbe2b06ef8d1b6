"""`Coding.to_common`: planes of all codings have the values that the models were trained with."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from codings import in_any_coding
from vdet.boxes import Image
from vdet.media import Planes
from vdet.media.coding import Coding, Layers


def common(image: Image, coding: Coding) -> Layers:
    return coding.to_common(Planes.of_image(image, coding).layers)


def apart(ours: Layers, other: Layers) -> list[npt.NDArray[np.int64]]:
    """Return how many levels each value of luma, blue and red differs."""
    return [np.abs(a.astype(np.int64) - b) for a, b in zip(ours, other, strict=True)]


def squares() -> Image:
    """Return an image of 16 × 24 squares of 16 pixels, each of one colour."""
    colours = np.random.default_rng(0).integers(0, 256, (16, 24, 3), dtype=np.uint8)
    return colours.repeat(16, 0).repeat(16, 1)


def middles(layers: Layers) -> Layers:
    """Return a value of each of the squares, away from their edges."""
    luma, blue, red = layers
    return luma[8::16, 8::16], blue[4::8, 4::8], red[4::8, 4::8]


@in_any_coding
def test_colours_become_those_of_opencv(coding: Coding) -> None:
    image = squares()
    luma, red, blue = cv2.split(cv2.cvtColor(image[8::16, 8::16], cv2.COLOR_BGR2YCrCb))
    expected = tuple(np.asarray(each, np.uint8) for each in (luma, blue, red))
    for each in apart(middles(common(image, coding)), (expected[0], expected[1], expected[2])):
        assert each.max() <= 2
        assert each.mean() < 1


@in_any_coding
@pytest.mark.parametrize(("height", "width"), [(48, 64), (47, 64), (48, 63), (47, 63)])
def test_chroma_may_have_half_the_size_or_that_of_luma(
    coding: Coding, height: int, width: int
) -> None:
    whole_luma, *chroma = Planes.of_image(squares()[4:60, 4:76], coding).layers
    luma = whole_luma[:height, :width]
    blue, red = (each[: -(-height // 2), : -(-width // 2)] for each in chroma)
    half = coding.to_common((luma, blue, red))
    blue, red = (each.repeat(2, 0).repeat(2, 1)[:height, :width] for each in (blue, red))
    whole = coding.to_common((luma, blue, red))
    np.testing.assert_array_equal(half[0], whole[0])
    for ours, other in zip(half[1:], whole[1:], strict=True):
        np.testing.assert_array_equal(ours.repeat(2, 0).repeat(2, 1)[:height, :width], other)


@in_any_coding
def test_grey_is_grey_from_black_to_white(coding: Coding) -> None:
    black, white = (0, 255) if coding.full_range else (16, 235)
    steps = np.arange(black, white + 1)
    luma = steps.astype(np.uint8)[np.newaxis]
    grey = np.full_like(luma, 128)
    ours, blue, red = coding.to_common((luma, grey, grey))
    np.testing.assert_allclose(ours[0], (steps - black) * 255 / (white - black), atol=0.5)
    assert (blue == 128).all()
    assert (red == 128).all()
