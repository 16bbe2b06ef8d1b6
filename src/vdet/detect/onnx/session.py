"""An ONNX file that onnxruntime has loaded, with its inputs and metadata."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.errors import ModelError
from vdet.files import read_whole

Array = npt.NDArray[Any]

MAX_BYTES = 1_000_000_000
"""Largest ONNX file that is read."""

TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
    "tensor(int64)": np.int64,
    "tensor(int32)": np.int32,
}
"""What onnxruntime calls the types of inputs."""

_ERRORS_ONLY = 3


class Session:
    """A network that is ready to run; threads may share it.

    Attributes
    ----------
    inputs
        Each has a `name`, a `shape` and a `type`, one of `TYPES`.

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
        self.inputs = self._session.get_inputs()
        for each in self.inputs:
            if each.type not in TYPES:
                message = f"its input {each.name} is a {each.type}; give a detector"
                raise ModelError(f"{path}: {message}")
        self.output_names = [each.name for each in self._session.get_outputs()]
        self.metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map

    def run(self, inputs: Mapping[str, Array]) -> list[Array]:
        """Return all outputs."""
        return [np.asarray(each) for each in self._session.run(None, dict(inputs))]


def first_line(error: Exception) -> str:
    """Return the first line of an error's message."""
    return str(error).partition("\n")[0]
