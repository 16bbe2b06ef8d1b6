"""Pictures by which a calibration can be judged: corners found, and straight lines straight."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from vdet.errors import OutputError
from vdet.files import check_output, make_folder
from vdet.lanes.calibration import Calibration, Pattern
from vdet.lanes.undistortion import Undistorter
from vdet.media.images import read_image, write_image


def check_previews(folder: Path, photos: Sequence[Path], *, overwrite: bool) -> None:
    """Make the folder, and refuse what cannot be written into it. Raises `OutputError`."""
    make_folder(folder)
    pictures = [_preview_of(photo, folder) for photo in photos]
    for picture in pictures:
        if pictures.count(picture) > 1:
            raise OutputError(f"{picture}: wanted by two photographs of one name; rename one")
        check_output(picture, overwrite=overwrite, inputs=photos)


def write_previews(folder: Path, calibration: Calibration, pattern: Pattern) -> None:
    """Write each photograph used, its corners drawn, as it is and undistorted, side by side."""
    for view in calibration.views:
        image = read_image(view.photo)
        undistorter = Undistorter(calibration.camera, *view.size)
        cv2.drawChessboardCorners(image, pattern, view.corners[:, None], True)
        both = np.hstack([image, undistorter.image(image)])
        write_image(_preview_of(view.photo, folder), both)


def _preview_of(photo: Path, folder: Path) -> Path:
    return folder / f"{photo.stem}.jpg"
