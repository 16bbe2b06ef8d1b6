"""A picture is an image or planes, and gives an image in both cases."""

import numpy as np

from vdet.media.coding import Coding
from vdet.media.picture import Picture
from vdet.media.planes import Planes

IMAGE = np.random.default_rng(0).integers(0, 256, (24, 40, 3), np.uint8)


def test_an_image_has_a_size_and_no_planes() -> None:
    picture = Picture(IMAGE)
    assert (picture.width, picture.height) == (40, 24)
    assert picture.image is IMAGE
    assert picture.planes is None


def test_planes_have_the_same_size_and_become_an_image() -> None:
    planes = Planes.of_image(IMAGE, Coding())
    picture = Picture(planes)
    assert (picture.width, picture.height) == (40, 24)
    assert picture.planes is planes
    np.testing.assert_array_equal(picture.image, planes.to_image())


def test_the_image_of_planes_is_made_once() -> None:
    picture = Picture(Planes.of_image(IMAGE, Coding()))
    assert picture.image is picture.image


def test_the_image_of_planes_does_not_share_their_memory() -> None:
    planes = Planes.of_image(IMAGE, Coding())
    luma = planes.luma.copy()
    Picture(planes).image[:] = 0
    np.testing.assert_array_equal(planes.luma, luma)
