"""How a coded picture is turned and mirrored to stand upright."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import av
import cv2
import numpy as np
import numpy.typing as npt

_Image = npt.NDArray[np.uint8]

_TURNS = {
    90: cv2.ROTATE_90_COUNTERCLOCKWISE,
    180: cv2.ROTATE_180,
    270: cv2.ROTATE_90_CLOCKWISE,
}


@dataclass(frozen=True, slots=True)
class Orientation:
    """How a coded picture becomes upright: mirrored left to right, or not, and then turned.

    `rotation` is counter-clockwise: 0, 90, 180 or 270 degrees.
    """

    rotation: int = 0
    mirrored: bool = False

    @property
    def is_sideways(self) -> bool:
        """Whether width and height change places."""
        return self.rotation in (90, 270)

    @classmethod
    def of_exif(cls, number: int) -> "Orientation":
        """Return the orientation of a number, 1 to 8, in EXIF data (CIPA DC-008, 4.6.4)."""
        rotation = (0, 0, 180, 180, 90, 270, 270, 90)[number - 1]
        return cls(rotation, mirrored=number in (2, 4, 5, 7))

    @classmethod
    def of_frame(cls, picture: av.VideoFrame) -> "Orientation":
        """Return the orientation of a decoded frame, by its display matrix.

        A matrix that is no quarter turn counts as the nearest one.
        """
        matrix = _display_matrix(picture)
        mirrored = bool(np.linalg.det(matrix) < 0)
        if mirrored:
            matrix = matrix * [[-1], [1]]  # of x
        degrees = math.degrees(math.atan2(-matrix[0, 1], matrix[0, 0]))
        return cls(round(degrees / 90) * 90 % 360, mirrored)


def _display_matrix(picture: av.VideoFrame) -> npt.NDArray[np.float64]:
    """Return what x and y become, as rows, of the display matrix (ISO/IEC 14496-12, 6.2.2)."""
    try:
        side_data = cast(Mapping[str, bytes], picture.side_data)  # it is not typed as such
    except ValueError:  # some of it is of a kind that PyAV does not know
        return np.eye(2)
    if "DISPLAYMATRIX" not in side_data:
        return np.eye(2)
    return np.frombuffer(bytes(side_data["DISPLAYMATRIX"]), np.int32).reshape(3, 3)[:2, :2] / 65_536


def upright(image: _Image, orientation: Orientation) -> _Image:
    """Return `image` as it is to be seen."""
    turned: cv2.typing.MatLike = cv2.flip(image, 1) if orientation.mirrored else image
    if orientation.rotation:
        turned = cv2.rotate(turned, _TURNS[orientation.rotation])
    return turned.astype(np.uint8, copy=False)
