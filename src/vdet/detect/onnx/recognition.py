"""Recognises the form of a network by its metadata, its names and its shapes."""

import ast
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationError

from vdet.config.section import Section
from vdet.detect.onnx import layouts
from vdet.detect.onnx.layouts import OutputLayout, RawBoxes, cell_centers
from vdet.detect.onnx.preparation import InputForm, size_of_area
from vdet.detect.onnx.session import TYPES, Array, Session
from vdet.errors import ModelError
from vdet.media import Picture

_MAX_SIDE = 16_384
_MAX_PIXELS = 16_000_000
_MOST_FINAL_ROWS = 1000
_NORMALISED = 2.0  # pixels of the input: no box of an ordinary network ends nearer to the corner
_DEFAULT_SIDE = 640  # of the usual exports with an input of any size
_SIZES = "orig_target_sizes"
_STILL_PIXELS = 1.44
"""Pixels of the input for a still picture, as a multiple of those for a frame of a video."""

COCO = tuple(Path(__file__).with_name("coco.txt").read_text("utf-8").splitlines())
"""The 80 classes of the COCO data set in the order that detectors number them."""

HEADER_KEY = "vdet"
"""Key of the metadata that holds the header."""


class Calibration(Section):
    """Score of a box: sigmoid(slope · x + offset), where x is the output of the network.

    It is the fraction of boxes with such an output that show a vehicle, fitted on cameras that were
    left out of trainings (Platt, 1999).
    """

    slope: float = Field(2.675, gt=0, le=100)
    offset: float = Field(0.61, ge=-100, le=100)


class Header(Section):
    """The header of our networks, JSON in the metadata of the ONNX file."""

    format: Literal[1] = 1
    classes: tuple[str, ...] = Field(min_length=1, max_length=1000)
    pixels: int = Field(147_456, ge=1024, le=_MAX_PIXELS)
    """Of the scaled frame of a video; a still picture has `_STILL_PIXELS` times as many."""
    calibration: Calibration = Calibration()
    by_class: dict[str, Calibration] = Field({}, max_length=1000)
    """The calibration of boxes that the network names so; of other classes, `calibration`."""
    provenance: dict[str, Any] = Field({})
    """What it was trained on and how, and its metrics."""


@dataclass(frozen=True, slots=True, eq=False)
class Recognized:
    """A network whose inputs and outputs are known.

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
        Turns its outputs into boxes.
    header
        The header of a network of ours; None for others.
    """

    session: Session
    name: str
    names: tuple[str, ...]
    form: InputForm
    layout: OutputLayout
    header: Header | None = None

    def for_frames(self, width: int, height: int, *, are_stills: bool = False) -> "Recognized":
        """Return the network with an input for frames of one size, width and height in pixels.

        Only the input of our networks depends on it. It is larger for still pictures, to find
        smaller vehicles: they need not keep up with a video.
        """
        if self.header is None:
            return self
        pixels = min(_MAX_PIXELS, self.header.pixels * (_STILL_PIXELS if are_stills else 1))
        return _ours(self.session, self.header, size_of_area(width, height, pixels))

    def find(self, picture: Picture, minimum: float) -> RawBoxes:
        """Return the boxes in pixels of the picture, with scores of at least `minimum`.

        Several threads may call this at once.

        Raises
        ------
        ModelError
            The network does not run, or its outputs are not what its form says.
        """
        values, place = self.form.prepare(picture)
        outputs = _outputs(self.session, self.form, values)
        try:
            with np.errstate(all="ignore"):  # numbers of any size
                raw = self.layout(outputs, minimum)
                found = replace(raw, boxes=place.to_frame(raw.boxes))
        except (ValueError, TypeError, IndexError) as error:
            raise _unknown(self.session, f"it gives {_shapes(outputs)}") from error
        if raw.boxes.max(initial=-math.inf) < _NORMALISED and len(raw.boxes):
            raise _unknown(self.session, "its boxes are fractions of the input, not pixels")
        return found


def recognize(session: Session, names: Sequence[str] = ()) -> Recognized:
    """Find the form of a network's inputs and outputs.

    Parameters
    ----------
    names
        Names of its classes, instead of those in the file.

    Raises
    ------
    ModelError
        The network has an unknown form; the message says how it differs.
    """
    header = read_header(session)
    if header is not None:
        shapes = session.output_shapes
        if [shape[2:] for shape in shapes] != [[5 + len(header.classes)]]:
            raise _unknown(session, f"it has a header of vdet, but gives {shapes}")
        return _ours(session, header, size_of_area(1, 1, header.pixels))
    has_sizes = any(slot.name == _SIZES for slot in session.inputs)
    if len(session.inputs) != 1 + has_sizes:
        raise _unknown(session, f"it has {len(session.inputs)} inputs")
    return _rt_detr(session, names) if has_sizes else _by_shape(session, names)


def read_header(session: Session) -> Header | None:
    """Return the header of a network of ours, None for another one. Raises `ModelError`."""
    if HEADER_KEY not in session.metadata:
        return None
    try:
        return Header.model_validate_json(session.metadata[HEADER_KEY])
    except ValidationError as error:
        raise ModelError(f"{session.path}: its header is damaged or from a newer vdet") from error


def _ours(session: Session, header: Header, size: tuple[int, int]) -> Recognized:
    """Return a network of ours with an input of one size, width and height in pixels."""
    form = InputForm(*size, rows_first=True, dtype=np.uint8)
    scores = [header.by_class.get(name, header.calibration) for name in header.classes]
    lines = np.array([(score.slope, score.offset) for score in scores], np.float32)
    layout = partial(layouts.our_cells, cells=cell_centers(*size), calibration=lines)
    return Recognized(session, "vdet", header.classes, form, layout, header)


def _rt_detr(session: Session, names: Sequence[str]) -> Recognized:
    outputs = session.output_names
    if not {"labels", "boxes", "scores"} <= set(outputs):
        raise _unknown(session, f"it has an input {_SIZES}, but outputs {', '.join(outputs)}")
    labels, boxes, scores = map(outputs.index, ("labels", "boxes", "scores"))
    layout = partial(layouts.named_columns, order=(labels, boxes, scores))
    form = replace(_form(session, None), fit="stretch")
    found = Recognized(session, "RT-DETR", tuple(names) or COCO, form, layout)
    found.find(Picture(form.grey), 0)  # raises where the shapes are others
    return found


def _by_shape(session: Session, names: Sequence[str]) -> Recognized:
    metadata = _ultralytics_metadata(session)
    form = _form(session, metadata.size)
    outputs = _outputs(session, form, form.prepare(Picture(form.grey))[0])
    found = _rule(outputs[0], form, metadata)
    if found is None:
        size = f"{form.width}×{form.height}"
        raise _unknown(session, f"for an input of {size} it gives {_shapes(outputs)}")
    name, classes, layout = found
    if name == "YOLOX":
        form = replace(form, fit="corner", is_rgb=False, factor=1.0)
    if "RT-DETR" in name:
        form = replace(form, fit="stretch")
    known = _names(session, tuple(names) or metadata.names, classes)
    return Recognized(session, name, known, form, layout)


_Rule = tuple[str, int | None, OutputLayout]
"""A form of output: its name, its number of classes (None: any), its layout."""


def _rule(output: Array, form: InputForm, metadata: "_Metadata") -> _Rule | None:
    """Return the form of the first output for a grey picture, if it is known."""
    if len(output.shape) != 3 or len(output) != 1:
        return None
    _, rows, columns = output.shape
    size, known = (form.width, form.height), len(metadata.names)
    grid = cell_centers(*size)
    cells = len(grid[1])
    final = "boxes after suppression", None, layouts.final_rows
    if metadata.is_rt_detr and columns == 4 + known and not metadata.is_final:
        return "RT-DETR of Ultralytics", known, partial(layouts.center_fractions, size=size)
    if columns == 6 and metadata.is_final:
        return final
    if columns == cells and known in (0, rows - 4):
        return "Ultralytics v8 or later", rows - 4, layouts.center_columns
    if rows == cells and columns >= 6 and not known:  # an exact number: before any number of rows
        is_decoded = output[..., :2].max() >= form.width / 2  # boxes spread over the input
        layout = partial(layouts.center_rows, grid=None if is_decoded else grid)
        return "YOLOX", columns - 5, layout
    return final if columns == 6 and rows <= _MOST_FINAL_ROWS else None


def _names(session: Session, names: tuple[str, ...], count: int | None) -> tuple[str, ...]:
    """Return the names of the classes; `count` is their number, if the output shows it."""
    if count is None:
        return names or COCO
    if names and len(names) != count:
        raise ModelError(f"{session.path}: has {count} classes, not {len(names)}; name them all")
    if known := names or {len(COCO): COCO, 1: ("vehicle",)}.get(count):
        return known
    lack = f"does not name its {count} classes; set detector.class_names"
    raise ModelError(f"{session.path}: {lack}")


class _Metadata(NamedTuple):
    """What Ultralytics writes into the metadata; nothing where another program wrote the file."""

    names: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    is_final: bool = False
    is_rt_detr: bool = False


def _ultralytics_metadata(session: Session) -> _Metadata:
    metadata = session.metadata
    try:
        names, side, args = (
            ast.literal_eval(metadata.get(key, "None")) for key in ("names", "imgsz", "args")
        )
        listed = names.values() if isinstance(names, dict) else names or ()
        known = tuple(str(item) for item in listed)
        size = (int(side[1]), int(side[0])) if side else None
        has_nms = bool((args or {}).get("nms"))
    except Exception as error:  # of many kinds: the text is any
        raise _unknown(session, "its metadata cannot be read") from error
    task = metadata.get("task", "detect")
    if task != "detect":
        raise _unknown(session, f"its task is {task:.40}, not detect")
    is_final = has_nms or metadata.get("end2end") == "True"
    model = metadata.get("description", "") + metadata.get("head", "")
    is_rt_detr = "rtdetr" in model.lower().replace("-", "")
    return _Metadata(known, size, is_final, is_rt_detr)


def _form(session: Session, size: tuple[int, int] | None) -> InputForm:
    """Return the usual input, of fixed size, or of the `size` in the metadata, or of 640×640."""
    slot = next(input_ for input_ in session.inputs if input_.name != _SIZES)
    shape = [side if isinstance(side, int) and side > 0 else None for side in slot.shape]
    if len(shape) != 4 or shape[0] not in (1, None) or shape[1] not in (3, None):
        seen = str(slot.shape).replace("None", "any")
        raise _unknown(session, f"its input is {seen:.100}, not [1, 3, height, width]")
    usual = size or (_DEFAULT_SIDE, _DEFAULT_SIDE)
    width, height = shape[3] or usual[0], shape[2] or usual[1]
    if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE and width * height <= _MAX_PIXELS):
        limits = f"{_MAX_PIXELS:,} pixels, or a side of more than {_MAX_SIDE:,}"
        raise _unknown(session, f"its input has no pixels, more than {limits}")
    return InputForm(width, height, "center", is_rgb=True, factor=1 / 255, dtype=TYPES[slot.type])


def _outputs(session: Session, form: InputForm, values: Array) -> list[Array]:
    """Return the outputs for a prepared input. Raises `ModelError` where it does not run."""
    inputs = {slot.name: values for slot in session.inputs}
    for slot in session.inputs:
        if slot.name == _SIZES:
            inputs[_SIZES] = np.array([[form.width, form.height]], TYPES[slot.type])
    return session.run(inputs)


def _shapes(outputs: Sequence[Array]) -> str:
    return " and ".join(str(output.shape) for output in outputs)


def _unknown(session: Session, seen: str) -> ModelError:
    return ModelError(f"{session.path}: has an unknown form: {seen}; see docs/networks.md")
