"""A network in an ONNX file: it runs, its form is recognized, and its output becomes boxes."""

import ast
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationError

from vdet.boxes import Float32Array, Image
from vdet.config.section import Section
from vdet.detect.onnx.water import without_drops
from vdet.errors import ModelError
from vdet.files import read_whole
from vdet.media import Picture

Array = npt.NDArray[Any]

MAX_BYTES = 500_000_000
"""Maximum size of an ONNX file."""
_OTHER_FORMS = {".xml": "OpenVINO", ".pt": "PyTorch", ".tflite": "TensorFlow Lite"}
_SILENT = 4  # log level of onnxruntime, because every error is also raised

_MAX_FINAL_ROWS = 1000
_NORMALISED = 2.0  # pixels of the input: boxes that all end nearer to the corner are fractions
_USUAL_SIZE = 640, 640  # for exports with a dynamic input size

COCO = tuple(Path(__file__).with_name("coco.txt").read_text("utf-8").splitlines())
"""The 80 classes of the COCO data set, in the order used by detectors."""

HEADER_KEY = "vdet"
"""Metadata key of the header."""

STRIDES = (8, 16, 32)
"""Distance between the cells of each level, pixels of the input."""

Cells = tuple[Float32Array, Float32Array]
"""Centres `(cells, 2)`, x and y in pixels of the input, and strides `(cells,)` of all cells."""

OutputLayout = Callable[[Array, float], Float32Array]
"""Converts an output to rows of a box, float32 `(n, 6)` or `(n, 6 + classes)`: x1, y1, x2, y2 in
pixels of the input, score, class, and the probability of each class if the network outputs it.

Scores below a minimum are dropped, not a NaN; nothing else is checked.
"""

_MULTIPLE = 32  # of pixels: the stride of the coarsest cells
GREY = 114
"""Value of input pixels outside the frame."""


class Session:
    """A network ready to run; threads may share it.

    Attributes
    ----------
    inputs
        Each has a `name`, a `shape` and a `type`, such as `tensor(float)`.

    Raises
    ------
    ModelError
        The file cannot be read, is not an ONNX file that onnxruntime can run, or has its weights in
        other files.
    """

    def __init__(self, path: Path) -> None:
        data = read_whole(path, limit=MAX_BYTES, what="model", error=ModelError)
        # Keeps onnxruntime from reporting to its maker and from writing into the home folder.
        os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
        import onnxruntime

        self.path = path
        options = onnxruntime.SessionOptions()
        # One thread, because frames run in parallel.
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.enable_mem_pattern = False  # it would reserve more than is used
        options.log_severity_level = _SILENT
        # External weights would be read from this folder, which cannot exist.
        folder = "session.model_external_initializers_file_folder_path"
        options.add_session_config_entry(folder, os.devnull)
        try:
            self._session = onnxruntime.InferenceSession(
                data, options, providers=["CPUExecutionProvider"]
            )
            self.metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.inputs = self._session.get_inputs()
        except Exception as error:  # onnxruntime raises its own kinds, and built-in ones
            if form := _OTHER_FORMS.get(path.suffix.lower()):
                advice = "export the network as ONNX (of Ultralytics: yolo export format=onnx)"
                raise ModelError(f"{path}: is a file of {form}; {advice}") from error
            raise ModelError(f"{path}: onnxruntime cannot load it: {_in_words(error)}") from error

    def run(self, values: Array) -> list[Array]:
        """Return all outputs for the values of the single input.

        Raises
        ------
        ModelError
            It fails.
        """
        try:
            outputs: list[Array] = self._session.run(None, {self.inputs[0].name: values})
        except Exception as error:  # onnxruntime raises its own kinds
            message = f"{self.path}: fails on an image: {_in_words(error)}"
            raise ModelError(message) from error
        return outputs


def _in_words(error: Exception) -> str:
    message = str(error)
    if "External data" in message:
        return "its weights are in other files; export it as one file"
    return message.partition("\n")[0][:200]


class ScoreCalibration(Section):
    """Score of a box: sigmoid(slope · x + offset), where x is the output of the network.

    It is the fraction of boxes with this output that show a vehicle, fitted on held-out cameras
    (Platt, 1999).
    """

    slope: float = Field(2.675, gt=0, le=100)
    offset: float = Field(0.61, ge=-100, le=100)


class Header(Section):
    """The header of our networks, JSON in the metadata of the ONNX file."""

    format: Literal[1] = 1
    classes: tuple[str, ...] = Field(min_length=1, max_length=1000)
    pixels: int = Field(147_456, ge=1024, le=16_000_000)
    """Pixels of the scaled video frame."""
    calibration: ScoreCalibration = ScoreCalibration()
    by_class: dict[str, ScoreCalibration] = Field({}, max_length=1000)
    """The calibration of boxes by class; `calibration` for other classes."""
    provenance: dict[str, Any] = Field({})
    """Training data, training settings and metrics."""


def vdet_cells(
    output: Array, minimum: float, *, cells: Cells, calibration: Float32Array
) -> Float32Array:
    """Read our own networks: `(1, cells, 5 + classes)`; see `vdet.learn.net.network`.

    `cells` are those of the input, from `cell_centers`; `calibration` `(classes, 2)` has slope and
    offset of each class.
    """
    (table,), (centers, strides) = output, cells
    if table.shape != (len(strides), 5 + len(calibration)):
        raise ValueError("not one row per cell, or not one column per class")
    best = table[:, 5:].argmax(axis=1)
    slopes, offsets = calibration[best].T
    logits = slopes * table[:, 0] + offsets
    rows = np.flatnonzero(~(logits < math.log(minimum / (1 - minimum))))
    lengths = np.logaddexp(0, table[rows, 1:5] + 1) * strides[rows, np.newaxis]
    middle = centers[rows]
    sides = np.concatenate([middle - lengths[:, :2], middle + lengths[:, 2:]], axis=1)
    class_scores = np.exp(table[rows, 5:] - table[rows, 5:].max(axis=1, keepdims=True))
    return _rows(sides, 1 / (1 + np.exp(-logits[rows])), best[rows], class_scores)


def center_columns(output: Array, minimum: float) -> Float32Array:
    """Read Ultralytics v8 and later: `(1, 4 + classes, n)`, columns of middle, size and scores."""
    table = output[0].T
    scores = table[:, 4:]
    best, classes = scores.max(axis=1), scores.argmax(axis=1)
    rows = np.flatnonzero(~(best < minimum))
    middle, half = table[rows, :2], table[rows, 2:4] / 2
    sides = np.concatenate([middle - half, middle + half], axis=1)
    return _rows(sides, best[rows], classes[rows], scores[rows])


def final_rows(output: Array, minimum: float) -> Float32Array:
    """Read `(1, n, 6)` after suppression: x1, y1, x2, y2, score, class; empty rows have score 0."""
    table = output[0]
    table = table[~(table[:, 4] < minimum)]
    return _rows(table[:, :4], table[:, 4], np.nan_to_num(table[:, 5], nan=-1))


def cell_centers(width: int, height: int) -> Cells:
    """Return centre and stride of all cells of an input."""
    centers, strides = [], []
    for stride in STRIDES:
        y, x = np.mgrid[: height // stride, : width // stride]
        centers.append((np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * stride)
        strides.append(np.full(x.size, stride))
    return np.concatenate(centers).astype(np.float32), np.concatenate(strides).astype(np.float32)


def _rows(
    sides: Array, scores: Array, classes: Array, class_scores: Array | None = None
) -> Float32Array:
    """Join the columns; each row of `class_scores`, at least 0, is normalized to a sum of 1."""
    columns = [sides, scores[:, np.newaxis].clip(0, 1), classes[:, np.newaxis]]
    if class_scores is not None:
        shares = np.nan_to_num(class_scores.astype(np.float32).clip(1e-9, 1))
        columns.append(shares / shares.sum(axis=1, keepdims=True))
    return np.concatenate(columns, axis=1, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class InputForm:
    """The form of a network's input.

    Attributes
    ----------
    width, height
        Size of the input, pixels.
    dtype
        uint8, for our own networks: `(1, height, width, 3)`, BGR, filled by the frame. Float32, for
        others: `(1, 3, height, width)`, RGB from 0 to 1; the frame keeps its aspect ratio and lies
        in the middle, with grey around it.
    """

    width: int
    height: int
    dtype: type[np.generic] = np.uint8

    def prepare(self, picture: Picture) -> Array:
        """Return the input for a frame."""
        image = self.scaled(picture)
        if self.dtype is np.uint8:
            return image[np.newaxis]
        return cv2.dnn.blobFromImage(image, 1 / 255, swapRB=True)

    def scaled(self, picture: Picture) -> Image:
        """Return the input as an image, BGR uint8; planes are scaled before conversion."""
        x, y, width, height = self._placed(picture)
        scaled = picture.to_bgr([_scaled(layer, width, height) for layer in picture.layers])
        if scaled.shape[:2] == (self.height, self.width):
            return scaled
        canvas = np.full((self.height, self.width, 3), GREY, np.uint8)
        canvas[y : y + height, x : x + width] = scaled
        return canvas

    def to_frame(self, sides: Float32Array, picture: Picture) -> Float32Array:
        """Convert boxes in the input, `(n, 4)` x1, y1, x2, y2, to pixels of the frame."""
        x, y, width, height = self._placed(picture)
        scales = np.array([width / picture.width, height / picture.height] * 2, np.float32)
        return np.asarray((sides - np.array([x, y] * 2, np.float32)) / scales)

    def _placed(self, picture: Picture) -> tuple[int, int, int, int]:
        """Return where the frame lies in the input: x, y, width, height."""
        width, height = self.width, self.height
        if self.dtype is not np.uint8:
            factor = min(width / picture.width, height / picture.height)
            width = max(1, round(picture.width * factor))
            height = max(1, round(picture.height * factor))
        return (self.width - width) // 2, (self.height - height) // 2, width, height


def size_of_area(width: int, height: int, pixels: float) -> tuple[int, int]:
    """Return an input size of about `pixels`, in the aspect ratio of a frame, for our networks."""
    factor = (pixels / (width * height)) ** 0.5 / _MULTIPLE
    return max(1, round(width * factor)) * _MULTIPLE, max(1, round(height * factor)) * _MULTIPLE


def _scaled(image: Image, width: int, height: int) -> Image:
    """Return an image in another size; it is halved first while it is more than twice as large.

    So every pixel counts, as in an area average, in a fraction of the time.
    """
    while image.shape[1] >= 2 * width and image.shape[0] >= 2 * height:
        half = max(width, image.shape[1] // 2), max(height, image.shape[0] // 2)
        image = np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)
        if half == (width, height):
            return image
    return np.asarray(cv2.resize(image, (width, height)), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Recognized:
    """A network with a known form of input and output.

    Attributes
    ----------
    session
        The network.
    name
        Name of the form, for messages.
    names
        Names of the classes, in the network's order.
    form
        The form of its input.
    layout
        Converts its output to boxes.
    header
        The header of our networks; None for others.
    is_named
        Whether the names are known; if not, they are assumed to be those of COCO.
    """

    session: Session
    name: str
    names: tuple[str, ...]
    form: InputForm
    layout: OutputLayout
    header: Header | None = None
    is_named: bool = True

    def for_frames(self, width: int, height: int, scale: float = 1.0) -> "Recognized":
        """Return the network with an input for frames of one size, width and height in pixels.

        Only the input of our networks depends on it; it has `scale` times as many pixels as usual.
        """
        if self.header is None:
            return self
        size = size_of_area(width, height, self.header.pixels * scale)
        return _of_vdet(self.session, self.header, size)

    def find(self, picture: Picture, minimum: float) -> Float32Array:
        """Return the rows of `OutputLayout`, in pixels of the picture, from score `minimum`.

        Our networks also search what lies behind water on the windscreen. Several threads may call
        this at once.

        Raises
        ------
        ModelError
            The network does not run, or its output is not what its form says.
        """
        values = self.form.prepare(picture)
        dry = without_drops(values[0]) if self.header else None
        inputs = [values] if dry is None else [values, dry[np.newaxis]]
        outputs = [self.session.run(item)[0] for item in inputs]
        try:
            with np.errstate(all="ignore"):  # numbers of any size
                boxes = np.concatenate([self.layout(output, minimum) for output in outputs])
                farthest = boxes[:, :4].max(initial=-math.inf)
                boxes[:, :4] = self.form.to_frame(boxes[:, :4], picture)
        except (ValueError, TypeError, IndexError) as error:
            raise _unknown(self.session, f"its output is {_shapes(outputs)}") from error
        if not np.isfinite(boxes[:, :5]).all():
            seen = "its output has numbers that are not finite"
            raise ModelError(f"{self.session.path}: {seen}; export it in float32")
        if len(boxes) and farthest < _NORMALISED:
            raise _unknown(self.session, "its boxes are fractions of the input, not pixels")
        return boxes


def recognize(session: Session, names: Sequence[str] = ()) -> Recognized:
    """Determine the form of a network's input and output.

    Parameters
    ----------
    names
        Names of its classes; replaces those in the file.

    Raises
    ------
    ModelError
        The form is unknown; the message says how it differs.
    """
    if len(session.inputs) != 1:
        raise _unknown(session, f"it has {len(session.inputs)} inputs, not one")
    header = read_header(session)
    if header is None:
        return _foreign(session, tuple(names))
    return _of_vdet(session, header, size_of_area(1, 1, header.pixels))


def read_header(session: Session) -> Header | None:
    """Return the header of our network, None for another one. Raises `ModelError`."""
    if HEADER_KEY not in session.metadata:
        return None
    try:
        return Header.model_validate_json(session.metadata[HEADER_KEY])
    except ValidationError as error:
        raise ModelError(f"{session.path}: its header is damaged or from a newer vdet") from error


def _of_vdet(session: Session, header: Header, size: tuple[int, int]) -> Recognized:
    """Return our network with an input of one size, width and height in pixels."""
    scores = [header.by_class.get(name, header.calibration) for name in header.classes]
    lines = np.array([(score.slope, score.offset) for score in scores], np.float32)
    width, height = size
    layout = partial(vdet_cells, cells=cell_centers(width, height), calibration=lines)
    form = InputForm(width, height)
    return Recognized(session, "vdet", header.classes, form, layout, header)


def _foreign(session: Session, names: tuple[str, ...]) -> Recognized:
    """Return a network of another tool, by the shape of its output for a black image."""
    names_in_file, size = _ultralytics_metadata(session)
    names = names or names_in_file
    form = _letterbox(session, size)
    outputs = session.run(np.zeros((1, 3, form.height, form.width), np.float32))
    cells = len(cell_centers(form.width, form.height)[1])
    match outputs[0].shape:
        case (1, rows, 6) if rows <= _MAX_FINAL_ROWS:
            name = "boxes after suppression"
            return Recognized(session, name, names or COCO, form, final_rows, is_named=bool(names))
        case (1, rows, columns) if columns == cells and rows > 4:
            names = names or {80: COCO, 1: ("vehicle",)}.get(rows - 4, ())
            if len(names) == rows - 4:
                name = "Ultralytics v8 or later"
                return Recognized(session, name, names, form, center_columns)
            seen = f"has {rows - 4} classes and {len(names)} names; set detector.class_names"
            raise ModelError(f"{session.path}: {seen}")
    expected = f"(1, 4 + classes, {cells}) or (1, n, 6)"
    raise _unknown(session, f"its output is {_shapes(outputs)}, not {expected}")


def _ultralytics_metadata(session: Session) -> tuple[tuple[str, ...], tuple[int, int]]:
    """Return the names of the classes, if known, and the usual input size."""
    metadata = session.metadata
    try:
        names, side = (ast.literal_eval(metadata.get(key, "None")) for key in ("names", "imgsz"))
        listed = names.values() if isinstance(names, dict) else names or ()
        size = (int(side[1]), int(side[0])) if side else _USUAL_SIZE
        class_names = tuple(map(str, listed))
    except Exception as error:  # many kinds: the text may be anything
        raise _unknown(session, "its metadata cannot be read") from error
    task = metadata.get("task", "detect")
    if task != "detect":
        raise _unknown(session, f"its task is {task:.40}, not detect")
    return class_names, size


def _letterbox(session: Session, usual: tuple[int, int]) -> InputForm:
    """Return the form of the input, with the `usual` size if it is dynamic."""
    (slot,) = session.inputs
    sides = [side if isinstance(side, int) and side > 0 else None for side in slot.shape]
    if len(sides) != 4 or sides[0] not in (1, None) or sides[1] not in (3, None):
        seen = str(slot.shape).replace("None", "any")
        raise _unknown(session, f"its input is {seen:.100}, not [1, 3, height, width]")
    if slot.type != "tensor(float)":
        raise _unknown(session, f"its input is a {slot.type}, not a tensor(float)")
    return InputForm(sides[3] or usual[0], sides[2] or usual[1], np.float32)


def _shapes(outputs: Sequence[Array]) -> str:
    return " and ".join(str(output.shape) for output in outputs)


def _unknown(session: Session, seen: str) -> ModelError:
    return ModelError(f"{session.path}: has an unknown form: {seen}; see docs/networks.md")
