"""Looks for a piece of an earlier frame in the neighbourhood of where it was."""

from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from vdet.geometry import Box

Image = npt.NDArray[np.uint8]
MatchMethod = Literal["ccoeff_normed", "ccorr_normed", "sqdiff_normed"]

_METHODS: dict[MatchMethod, int] = {
    "ccoeff_normed": cv2.TM_CCOEFF_NORMED,
    "ccorr_normed": cv2.TM_CCORR_NORMED,
    "sqdiff_normed": cv2.TM_SQDIFF_NORMED,
}


def find(
    image: Image,
    template: Image,
    near: Box,
    *,
    distance: int,
    method: MatchMethod,
    min_score: float,
) -> Box | None:
    """Return where `template` fits `image` best, if it fits well enough.

    Parameters
    ----------
    image, template
        BGR uint8 `(H, W, 3)`.
    near
        Where the template was in its own frame, full-frame pixels.
    distance
        How far its top left corner may have moved, pixels, in a straight line. Nothing outside
        `near` grown by so much is looked at.
    method
        As `cv2.matchTemplate` names it.
    min_score
        0 to 1; 1 is a perfect fit by every method (`sqdiff_normed` is turned round).

    Returns
    -------
    The place, of the template's size and inside the image. None where nothing scores `min_score`,
    where the template does not fit into the searched area, and for a template of one colour,
    which fits anything flat.
    """
    height, width = template.shape[:2]
    grown = Box(near.x - distance, near.y - distance, width + 2 * distance, height + 2 * distance)
    area = grown.clipped(image.shape[1], image.shape[0])
    if area.width < width or area.height < height or _is_flat(template):
        return None
    scores = _scores(image[area.y : area.bottom, area.x : area.right], template, method)
    dy, dx = np.ogrid[: scores.shape[0], : scores.shape[1]]
    scores[np.hypot(area.x + dx - near.x, area.y + dy - near.y) > distance] = -1
    y, x = np.unravel_index(int(scores.argmax()), scores.shape)
    if round(float(scores[y, x]), 4) < min_score:  # a perfect fit may score 0.9999998
        return None
    return Box(area.x + int(x), area.y + int(y), width, height)


def _is_flat(image: Image) -> bool:
    return image.size == 0 or bool((image == image[0, 0]).all())


def _scores(area: Image, template: Image, method: MatchMethod) -> npt.NDArray[np.float32]:
    scores = np.asarray(cv2.matchTemplate(area, template, _METHODS[method]), np.float32)
    return 1 - scores if method == "sqdiff_normed" else scores
