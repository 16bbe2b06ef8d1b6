"""An ONNX file as it is loaded by onnxruntime, with what it says of itself."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.errors import ModelError
from vdet.files import read_whole

Array = npt.NDArray[Any]

MAX_BYTES = 1_000_000_000
"""Largest ONNX file that is read."""

_TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
}
_ERRORS_ONLY = 3


@dataclass(frozen=True, slots=True)
class InputSlot:
    """An input of a network: its name, its shape (None: any length), and its type."""

    name: str
    shape: tuple[int | None, ...]
    dtype: type[np.generic]


class Session:
    """A network that is ready to run; threads may share it.

    Raises
    ------
    ModelError
        The file cannot be read, or is no ONNX file that onnxruntime can run.
    """

    def __init__(self, path: Path) -> None:
        data = read_whole(path, most=MAX_BYTES, what="model", error=ModelError)
        # Keeps onnxruntime from reporting to its maker and from writing into the home folder.
        os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # frames run in parallel
        options.log_severity_level = _ERRORS_ONLY
        providers = ["CPUExecutionProvider"]
        try:
            self._session = onnxruntime.InferenceSession(data, options, providers=providers)
        except Exception as error:  # onnxruntime raises kinds of its own, and plain ones
            reason = first_line(error)
            raise ModelError(f"{path}: cannot be loaded by onnxruntime: {reason:.200}") from error
        self.path = path
        self.inputs = tuple(_slot(path, each) for each in self._session.get_inputs())
        self.output_names = [each.name for each in self._session.get_outputs()]
        self.metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map

    def run(self, inputs: Mapping[str, Array]) -> list[Array]:
        """Return all outputs."""
        return [np.asarray(each) for each in self._session.run(None, dict(inputs))]


def first_line(error: Exception) -> str:
    """Return the first line of what onnxruntime says of an error."""
    return str(error).partition("\n")[0]


def _slot(path: Path, value: Any) -> InputSlot:
    if value.type not in _TYPES:
        raise ModelError(f"{path}: its input {value.name} is a {value.type}; give a detector")
    shape = tuple(each if isinstance(each, int) and each > 0 else None for each in value.shape)
    return InputSlot(value.name, shape, _TYPES[value.type])
