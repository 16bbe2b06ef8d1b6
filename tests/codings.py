"""All ways in which planes are coded, and a picture of each."""

import cv2
import numpy as np
import pytest

from vdet.media import Picture, Planes
from vdet.media.frame import Coding

LIMITED, FULL, HD = Coding(), Coding(full_range=True), Coding("bt709")
CODINGS = {
    "BT.601": LIMITED,
    "BT.601, full range": FULL,
    "BT.709": HD,
    "BT.709, full range": Coding("bt709", full_range=True),
}
in_any_coding = pytest.mark.parametrize("coding", CODINGS.values(), ids=CODINGS)


def smooth_picture(coding: Coding) -> Picture:
    """Return planes of 192 × 144 pixels whose colours change slowly."""
    coarse = np.random.default_rng(0).integers(0, 256, (9, 12, 3), dtype=np.uint8)
    image = np.asarray(cv2.resize(coarse, (192, 144), interpolation=cv2.INTER_CUBIC), np.uint8)
    return Picture(Planes.of_image(image, coding))
