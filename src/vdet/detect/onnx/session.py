"""An ONNX file loaded by onnxruntime."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy.typing as npt

from vdet.errors import ModelError
from vdet.files import read_whole

Array = npt.NDArray[Any]

MAX_BYTES = 500_000_000
"""Maximum size of an ONNX file."""
_SILENT = 4  # log level of onnxruntime, because every error is also raised


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
