"""The camera file: a camera as short YAML that people can read."""

from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError, model_validator
from pydantic_core import ErrorDetails

from vdet.config.document import Document, config_error, format_key, read_document
from vdet.config.section import Section
from vdet.errors import ConfigError
from vdet.files import staged
from vdet.lanes.camera import CalibratedCamera

_Side = Annotated[int, Field(ge=16, le=100_000)]
_Coefficient = Annotated[float, Field(ge=-1000, le=1000)]
_Row = tuple[float, float, float]


class _CameraFile(Section):
    width: _Side
    height: _Side
    matrix: tuple[_Row, _Row, _Row]
    distortion: tuple[_Coefficient, _Coefficient, _Coefficient, _Coefficient, _Coefficient]
    rms: float = Field(ge=0)

    @model_validator(mode="after")
    def _check_matrix_form(self) -> "_CameraFile":
        (_, skew, _), (zero, _, _), last = self.matrix
        if (skew, zero, last) != (0, 0, (0, 0, 1)):
            raise ValueError("matrix should be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
        return self


def save_camera(camera: CalibratedCamera, path: Path, *, overwrite: bool = False) -> None:
    """Write a camera as YAML. Raises `OutputError`."""
    rows = "\n".join(f"  - [{', '.join(map(repr, row))}]" for row in camera.matrix.tolist())
    text = f"""\
# A camera, written by `vdet calibrate`.

# frame size, pixels
width: {camera.width}
height: {camera.height}
# focal lengths and principal point, pixels: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
matrix:
{rows}
# lens distortion (OpenCV's model): [k1, k2, p1, p2, k3]
distortion: [{", ".join(map(repr, camera.distortion))}]
# root mean square error of the chessboard corners, pixels
rms: {camera.rms!r}
"""
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def load_camera(path: Path) -> CalibratedCamera:
    """Read a camera file.

    Raises
    ------
    ConfigError
        The file cannot be read, is not YAML, or is not a camera file; one line for each mistake.
    """
    document = read_document(path)
    try:
        read = _CameraFile.model_validate(document.values)
    except ValidationError as error:
        lines = (_describe(detail, document) for detail in error.errors())
        raise config_error(lines, error.error_count()) from error
    (fx, _, cx), (_, fy, cy), _ = read.matrix
    camera = CalibratedCamera(
        read.width, read.height, (fx, fy), (cx, cy), read.distortion, read.rms
    )
    if camera.problem:
        raise ConfigError(f"{document.places['matrix',]}: matrix: {camera.problem}")
    return camera


def _describe(detail: ErrorDetails, document: Document) -> str:
    key = tuple(detail["loc"])
    match detail["type"]:
        case "missing":
            text = "is missing; `vdet calibrate` writes camera files"
        case "extra_forbidden":
            known = ", ".join(_CameraFile.model_fields)
            text = f"is not a key of camera files; known: {known}"
        case _:
            text = detail["msg"].removeprefix("Value error, ").removeprefix("Input ")
    place = document.place_of(key)
    return f"{place}: {format_key(key)}: {text}" if key else f"{place}: {text}"
