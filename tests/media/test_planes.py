"""Pictures as planes: which decoded ones come so, and how an image becomes planes."""

from typing import Literal

import av
import numpy as np
import numpy.typing as npt
import pytest
from av.video.reformatter import ColorRange

from codings import in_any_coding
from vdet.boxes import Box, Image
from vdet.media.frame import Coding, Picture, Planes


def decoded(pixels: str, *, matrix: int, full_range: bool) -> av.VideoFrame:
    """Return a picture as a decoder gives it: of a pixel format, with its tags."""
    grey = np.full((32, 32, 3), 90, np.uint8)
    picture = av.VideoFrame.from_ndarray(grey, format="bgr24").reformat(format=pixels)
    picture.colorspace = matrix
    picture.color_range = ColorRange.JPEG if full_range else ColorRange.MPEG
    return picture


def slopes(width: int, height: int) -> Image:
    """Return an image with all kinds of colours, but no edges."""
    y, x = np.mgrid[:height, :width] / [[[height]], [[width]]]
    layers = [20 + 210 * x, 30 + 190 * y, 240 - 110 * (x + y)]
    return np.stack(layers, axis=-1).astype(np.uint8)


OTHER_FORMS = ("yuv444p", "yuvj444p", "yuv422p", "yuv420p10le", "nv12", "gray", "bgr24")


@pytest.mark.parametrize("full_range", [False, True])
@pytest.mark.parametrize(
    ("pixels", "matrix", "name"),
    [
        *(("yuv420p", matrix, "bt601") for matrix in (2, 5, 6)),
        ("yuv420p", 1, "bt709"),
        *(("yuv420p", matrix, None) for matrix in (4, 7, 9, 10)),
        *((pixels, 2, None) for pixels in OTHER_FORMS),
    ],
)
def test_planes_have_the_coding_that_their_tags_name_and_other_forms_none(
    pixels: str, matrix: int, name: Literal["bt601", "bt709"] | None, *, full_range: bool
) -> None:
    found = Coding.of(decoded(pixels, matrix=matrix, full_range=full_range))
    assert found == (Coding(name, full_range=full_range) if name else None)


@in_any_coding
def test_a_copy_has_the_same_values_and_coding_in_memory_of_its_own(coding: Coding) -> None:
    original = Planes.of_image(slopes(64, 48), coding)
    copied = original.copy()
    assert copied.is_writable
    assert (copied.shape, copied.coding) == (original.shape, coding)
    for ours, theirs in zip(copied.layers, original.layers, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    before = [layer.copy() for layer in original.layers]
    for layer in copied.layers:
        layer[:] = 0
    for layer, expected in zip(original.layers, before, strict=True):
        np.testing.assert_array_equal(layer, expected)


@in_any_coding
def test_an_odd_side_grows_by_its_last_row_or_column(coding: Coding) -> None:
    image = np.zeros((5, 7, 3), np.uint8)
    image[4:, :] = image[:, 6:] = 200
    luma = Planes.of_image(image, coding).luma
    assert luma.shape == (6, 8)
    assert (luma[5] == luma[4]).all()
    assert (luma[:, 7] == luma[:, 6]).all()
    assert luma[5, 7] > luma[0, 0]


@in_any_coding
def test_a_picture_is_the_same_as_planes_and_back(coding: Coding) -> None:
    image = slopes(96, 64)
    difference = np.abs(Planes.of_image(image, coding).to_image().astype(int) - image)
    assert difference.max() <= 9
    assert difference.mean() < 2.5


def exact_image(planes: Planes) -> npt.NDArray[np.float64]:
    """Return what ITU-R BT.601 or BT.709 say of planes, BGR from 0 to 255, not rounded."""
    of_red, of_blue = (0.2126, 0.0722) if planes.coding.matrix == "bt709" else (0.299, 0.114)
    base, luma_steps, chroma_steps = (0, 255, 255) if planes.coding.full_range else (16, 219, 224)
    height, width = planes.shape
    luma = (planes.luma - float(base)) / luma_steps
    blue, red = (
        ((item - 128.0) / chroma_steps).repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
        for item in (planes.blue, planes.red)
    )
    blue, red = luma + blue * (2 - 2 * of_blue), luma + red * (2 - 2 * of_red)
    green = (luma - of_red * red - of_blue * blue) / (1 - of_red - of_blue)
    return 255 * np.clip(np.stack([blue, green, red], axis=-1), 0, 1)


def blocks_of_any_colour(width: int, height: int, coding: Coding) -> Planes:
    """Return planes of one random colour for each value of chroma, coded as the standard says."""
    planes = Planes(av.VideoFrame(width, height, "yuv420p"), coding, is_writable=True)
    of_red, of_blue = (0.2126, 0.0722) if coding.matrix == "bt709" else (0.299, 0.114)
    base, luma_steps, chroma_steps = (0, 255, 255) if coding.full_range else (16, 219, 224)
    blue, green, red = np.random.default_rng(width).random((3, *planes.blue.shape))
    luma = of_red * red + (1 - of_red - of_blue) * green + of_blue * blue
    planes.blue[:] = np.rint(128 + chroma_steps * (blue - luma) / (2 - 2 * of_blue)).clip(0, 255)
    planes.red[:] = np.rint(128 + chroma_steps * (red - luma) / (2 - 2 * of_red)).clip(0, 255)
    whole = luma.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    planes.luma[:] = np.rint(base + luma_steps * whole)
    return planes


@in_any_coding
@pytest.mark.parametrize("size", [(64, 48), (33, 48), (64, 47), (7, 5)])
def test_an_image_is_what_the_standard_says(coding: Coding, size: tuple[int, int]) -> None:
    width, height = size
    planes = blocks_of_any_colour(width, height, coding)
    image = planes.to_image()
    assert image.shape == (height, width, 3)
    assert image.dtype == np.uint8
    differences = np.abs(image - exact_image(planes))
    assert differences.max() < 3.5
    assert differences.mean() < 1


# `Coding.to_common`: planes of all codings have the values that the models were trained with.


def squares() -> Image:
    """Return an image of 16 × 24 squares of 16 pixels, each of one colour."""
    colours = np.random.default_rng(0).integers(0, 256, (16, 24, 3), dtype=np.uint8)
    return colours.repeat(16, 0).repeat(16, 1)


@in_any_coding
@pytest.mark.parametrize(("height", "width"), [(48, 64), (47, 64), (48, 63), (47, 63)])
def test_chroma_may_have_half_the_size_or_that_of_luma(
    coding: Coding, height: int, width: int
) -> None:
    whole_luma, *chroma = Planes.of_image(squares()[4:60, 4:76], coding).layers
    luma = whole_luma[:height, :width]
    blue, red = (item[: -(-height // 2), : -(-width // 2)] for item in chroma)
    half = coding.to_common((luma, blue, red))
    blue, red = (item.repeat(2, 0).repeat(2, 1)[:height, :width] for item in (blue, red))
    whole = coding.to_common((luma, blue, red))
    np.testing.assert_array_equal(half[0], whole[0])
    for ours, other in zip(half[1:], whole[1:], strict=True):
        np.testing.assert_array_equal(ours.repeat(2, 0).repeat(2, 1)[:height, :width], other)


@in_any_coding
@pytest.mark.parametrize("box", [Box(7, 5, 30, 20), Box(8, 6, 31, 21), Box(-5, -5, 70, 9)])
def test_a_part_has_the_colours_of_the_whole_also_after_it_changed(
    coding: Coding, box: Box
) -> None:
    picture = Picture(Planes.of_image(slopes(64, 48), coding))
    expected, part = box.cut(picture.image).astype(int), picture.deferred_crop(box)
    assert picture.planes
    picture.planes.luma[:] = 0
    np.testing.assert_allclose(part().astype(int), expected, atol=4)
