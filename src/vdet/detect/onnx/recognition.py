"""What kind of network an ONNX file holds: by its metadata, then its names, then its shapes."""

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, ValidationError

from vdet.config.section import Section
from vdet.config.train import NetworkScoreSettings
from vdet.detect.onnx.layouts import (
    CenterRows,
    FinalRows,
    Layout,
    NamedColumns,
    OurCells,
    cell_centers,
    cell_count,
)
from vdet.detect.onnx.preparation import GREY, InputForm, size_of_area
from vdet.detect.onnx.session import Array, InputSlot, Session, first_line
from vdet.errors import ModelError
from vdet.media import Picture

_MULTIPLE = 32
_MOST_FINAL_ROWS = 1000
_DEFAULT_SIDE = 640  # of the usual exports with an input of any size
_SIZES = "orig_target_sizes"


# fmt: off
COCO = (
    "person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat",
    "traffic light", "fire hydrant", "stop sign", "parking meter", "bench", "bird", "cat", "dog",
    "horse", "sheep", "cow", "elephant", "bear", "zebra", "giraffe", "backpack", "umbrella",
    "handbag", "tie", "suitcase", "frisbee", "skis", "snowboard", "sports ball", "kite",
    "baseball bat", "baseball glove", "skateboard", "surfboard", "tennis racket", "bottle",
    "wine glass", "cup", "fork", "knife", "spoon", "bowl", "banana", "apple", "sandwich",
    "orange", "broccoli", "carrot", "hot dog", "pizza", "donut", "cake", "chair", "couch",
    "potted plant", "bed", "dining table", "toilet", "tv", "laptop", "mouse", "remote",
    "keyboard", "cell phone", "microwave", "oven", "toaster", "sink", "refrigerator", "book",
    "clock", "vase", "scissors", "teddy bear", "hair drier", "toothbrush",
)
# fmt: on
"""The 80 classes of the COCO data set in the order that detectors number them."""

HEADER_KEY = "vdet"
"""Key of the metadata that holds the header."""


class Header(Section):
    """What an ONNX file says of a network of ours."""

    format: Literal[1] = 1
    classes: tuple[str, ...] = Field(min_length=1, max_length=1000)
    pixels: int = Field(147_456, ge=1024, le=16_000_000, description="of the scaled frame")
    calibration: NetworkScoreSettings = NetworkScoreSettings()
    provenance: dict[str, Any] = Field(
        default={}, description="what it was trained on and how, and what it reached"
    )


@dataclass(frozen=True, slots=True)
class Recognized:
    """What an ONNX file holds.

    Attributes
    ----------
    name
        Name of the form, for people.
    reasons
        Why it was taken for this form.
    names
        Names of the classes, as the network counts them.
    form
        What the network wants to see.
    layout
        Turns its outputs into boxes.
    has_sizes
        Whether it has a second input for the size of the picture.
    header
        The header of a network of ours; None for others.
    """

    name: str
    reasons: tuple[str, ...]
    names: tuple[str, ...]
    form: InputForm
    layout: Layout
    has_sizes: bool = False
    header: Header | None = None

    def for_frames(self, width: int, height: int) -> "Recognized":
        """Return the network for frames of one size; the input of our own is fitted to it."""
        if self.header is None:
            return self
        form, layout = _our_form(self.header, width, height)
        return replace(self, form=form, layout=layout)

    def feed(self, session: Session, values: Array) -> dict[str, Array]:
        """Return all inputs by name, for the input `values` of a picture."""
        feed = {_picture_slot(session).name: values}
        if self.has_sizes:
            slot = next(each for each in session.inputs if each.name == _SIZES)
            size = [[self.form.width, self.form.height]]
            feed[_SIZES] = np.array(size, slot.dtype)
        return feed


def recognize(session: Session, path: Path, names: Sequence[str] = ()) -> Recognized:
    """Find out what a network wants and gives.

    Parameters
    ----------
    path
        Its file, for messages.
    names
        Names of its classes, where the file does not tell them.

    Raises
    ------
    ModelError
        The network is of no known form; the message says what was seen.
    """
    header = read_header(session, path)
    if header is not None:
        return _ours(session, path, header)
    if any(slot.name == _SIZES for slot in session.inputs):
        return _rt_detr(session, path, names)
    if len(session.inputs) != 1:
        raise _unknown(path, f"it has {len(session.inputs)} inputs")
    return _by_shape(session, path, names)


def read_header(session: Session, path: Path) -> Header | None:
    """Return the header of a network of ours, None of another one. Raises `ModelError`."""
    if HEADER_KEY not in session.metadata:
        return None
    try:
        return Header.model_validate_json(session.metadata[HEADER_KEY])
    except ValidationError as error:
        raise ModelError(f"{path}: its header is damaged or from a newer vdet") from error


def _ours(session: Session, path: Path, header: Header) -> Recognized:
    form, layout = _our_form(header, 1, 1)
    reasons = ("it has a header of vdet",)
    found = Recognized("vdet", reasons, header.classes, form, layout, header=header)
    shapes = [output.shape for output in _outputs_for_grey(session, path, found)]
    wanted = (1, cell_count(form.width, form.height), 5 + len(header.classes))
    if shapes != [wanted]:
        raise _unknown(path, f"it has a header of vdet, but gives {_listed(shapes)}")
    return found


def _our_form(header: Header, width: int, height: int) -> tuple[InputForm, OurCells]:
    """Return what a network of ours wants to see of frames of one size, and what it gives."""
    size = size_of_area(width, height, header.pixels, _MULTIPLE)
    form = InputForm(*size, rows_first=True, dtype=np.uint8)
    return form, OurCells(cell_centers(*size), header.calibration)


def _rt_detr(session: Session, path: Path, names: Sequence[str]) -> Recognized:
    places = {name: place for place, name in enumerate(session.output_names)}
    if not {"labels", "boxes", "scores"} <= set(places):
        raise _unknown(path, f"it has an input {_SIZES}, but outputs {', '.join(places)}")
    width, height = _size_of(session, None)
    form = InputForm(width, height, is_rgb=True, factor=1 / 255, dtype=_picture_slot(session).dtype)
    layout = NamedColumns((places["labels"], places["boxes"], places["scores"]))
    reasons = (f"it has an input {_SIZES}", "its outputs are labels, boxes and scores")
    return Recognized("RT-DETR", reasons, tuple(names) or COCO, form, layout, has_sizes=True)


def _by_shape(session: Session, path: Path, names: Sequence[str]) -> Recognized:
    metadata = _ultralytics_metadata(session.metadata, path)
    width, height = _size_of(session, metadata.size)
    slot = _picture_slot(session)
    if len(slot.shape) != 4 or slot.shape[1] not in (3, None):
        raise _unknown(path, f"its input is {_listed([slot.shape])}, not (1, 3, height, width)")
    form = InputForm(width, height, "center", is_rgb=True, factor=1 / 255, dtype=slot.dtype)
    guess = Recognized("", (), tuple(names) or metadata.names, form, FinalRows())
    shapes = [output.shape for output in _outputs_for_grey(session, path, guess)]
    if len(shapes[0]) != 3 or shapes[0][0] != 1:
        raise _unknown(path, f"its output is {_listed(shapes)}")
    _, rows, columns = shapes[0]
    for rule in _rules(rows, columns, cell_count(width, height), metadata):
        if rule.fits:
            break
    else:
        raise _unknown(path, f"for an input of {width}×{height} it gives {_listed(shapes)}")
    seen = ("its metadata has the keys of Ultralytics",) if metadata else ()
    reasons = (*seen, f"its output is {shapes[0]}: {rule.reason}")
    found = replace(guess, name=rule.name, reasons=reasons, layout=rule.layout)
    if rule.name == "YOLOX":
        found = _as_yolox(found, session, path)
    return replace(found, names=_names_of(found, rows if rule.is_turned else columns, path))


@dataclass(frozen=True, slots=True)
class _Rule:
    """A form of output: whether it fits what was seen, its name, and the reason in words."""

    fits: bool
    name: str
    reason: str
    layout: FinalRows | CenterRows

    @property
    def is_turned(self) -> bool:
        return isinstance(self.layout, CenterRows) and self.layout.is_turned


def _rules(rows: int, columns: int, cells: int, metadata: "_Metadata") -> Sequence[_Rule]:
    """Return all forms, for an output of `rows` and `columns`; the first that fits counts."""
    bare, classes = not metadata, len(metadata.names)
    return (
        _Rule(
            columns == 6 and (metadata.is_final or rows <= _MOST_FINAL_ROWS),
            "boxes after suppression",
            "rows of box, score and class",
            FinalRows(),
        ),
        _Rule(
            columns == cells and (bare or rows == 4 + classes),
            "Ultralytics v8 or later",
            "columns of box and class scores",
            CenterRows(has_objectness=False, is_turned=True),
        ),
        _Rule(
            rows == 3 * cells and (bare or columns == 5 + classes),
            "Ultralytics v5",
            "three boxes a cell",
            CenterRows(has_objectness=True),
        ),
        _Rule(
            rows == cells and columns >= 6 and bare,
            "YOLOX",
            "one box a cell, and no metadata",
            CenterRows(has_objectness=True),
        ),
    )


def _as_yolox(found: Recognized, session: Session, path: Path) -> Recognized:
    """Return YOLOX with its own form of input, and decoded where the export left that out."""
    found = replace(found, form=replace(found.form, fit="corner", is_rgb=False, factor=1.0))
    middles = _outputs_for_grey(session, path, found)[0][0][:, 0]
    if np.ptp(middles) >= found.form.width / 2:  # they spread over the input
        return found
    grid = cell_centers(found.form.width, found.form.height)
    reasons = (*found.reasons, "its middles are offsets from cells")
    return replace(found, layout=CenterRows(has_objectness=True, grid=grid), reasons=reasons)


def _names_of(found: Recognized, length: int, path: Path) -> tuple[str, ...]:
    """Return the names of the classes; `length` is that of a row or column of the output."""
    if isinstance(found.layout, FinalRows):
        return found.names or COCO
    assert isinstance(found.layout, CenterRows)
    count = length - (5 if found.layout.has_objectness else 4)
    if len(found.names) == count:
        return found.names
    if found.names:
        raise ModelError(f"{path}: has {count} classes, not {len(found.names)}; name them all")
    usual = {len(COCO): COCO, 1: ("vehicle",)}
    if count not in usual:
        raise ModelError(f"{path}: does not name its {count} classes; give detector.names")
    return usual[count]


@dataclass(frozen=True, slots=True)
class _Metadata:
    """What Ultralytics writes into the metadata; nothing where another program wrote the file."""

    names: tuple[str, ...] = ()
    size: tuple[int, int] | None = None
    is_final: bool = False

    def __bool__(self) -> bool:
        return bool(self.names)


def _ultralytics_metadata(metadata: Mapping[str, str], path: Path) -> _Metadata:
    try:
        values = {
            key: ast.literal_eval(metadata[key]) if key in metadata else None
            for key in ("names", "imgsz", "args")
        }
        names = values["names"] or {}
        listed = tuple(names.values()) if isinstance(names, dict) else tuple(names)
        side = values["imgsz"]
        size = (int(side[1]), int(side[0])) if side else None
        args = values["args"] or {}
    except (ValueError, SyntaxError, TypeError, IndexError, KeyError) as error:
        raise _unknown(path, "its metadata cannot be read") from error
    task = metadata.get("task", "detect")
    if task != "detect":
        raise _unknown(path, f"its task is {task}, not detect")
    is_final = bool(args.get("nms")) or metadata.get("end2end", "False") == "True"
    return _Metadata(tuple(str(each) for each in listed), size, is_final)


def _picture_slot(session: Session) -> InputSlot:
    return next(slot for slot in session.inputs if slot.name != _SIZES)


def _size_of(session: Session, told: tuple[int, int] | None) -> tuple[int, int]:
    """Return width and height of the input: fixed, or told, or the usual."""
    shape = _picture_slot(session).shape
    height, width = shape[2:4] if len(shape) == 4 else (None, None)
    usual = told or (_DEFAULT_SIDE, _DEFAULT_SIDE)
    return width or usual[0], height or usual[1]


def _outputs_for_grey(session: Session, path: Path, guess: Recognized) -> list[Array]:
    """Return the outputs for a grey picture."""
    grey = np.full((guess.form.height, guess.form.width, 3), GREY, np.uint8)
    try:
        return session.run(guess.feed(session, guess.form.prepare(Picture(grey))[0]))
    except Exception as error:  # onnxruntime raises kinds of its own
        seen = f"it does not run on a picture ({first_line(error):.120})"
        raise _unknown(path, seen) from error


def _listed(shapes: Sequence[tuple[int | None, ...]]) -> str:
    return " and ".join(
        "(" + ", ".join("any" if side is None else str(side) for side in shape) + ")"
        for shape in shapes
    )


def _unknown(path: Path, seen: str) -> ModelError:
    return ModelError(
        f"{path}: is of no form that vdet knows: {seen}; docs/networks.md lists the forms"
    )
