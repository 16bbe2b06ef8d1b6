"""An ONNX file loaded by onnxruntime, with limits on time and memory."""

import os
import threading
from collections.abc import Mapping
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy.typing as npt

from vdet.errors import ModelError
from vdet.files import read_whole
from vdet.workers import core_count

Array = npt.NDArray[Any]

MAX_BYTES = 500_000_000
"""Maximum size of an ONNX file."""
MAX_SECONDS = 60
"""Maximum time for one image."""
_MAX_MEMORY = 1_000_000_000  # bytes per core while it runs: one image per core
_MAX_METADATA = 200_000  # characters of one value

_SILENT = 4  # log level of onnxruntime, because every error is also raised


class Session:
    """A network ready to run; threads may share it.

    Attributes
    ----------
    inputs
        Each has a `name`, a `shape` and a `type`, such as `tensor(float)`.
    output_shapes
        Declared shapes; lengths that depend on the input are names.

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
        self._new_options = onnxruntime.RunOptions
        try:
            self._session = onnxruntime.InferenceSession(
                data,
                _limited_options(),
                providers=["CPUExecutionProvider"],
                disabled_optimizers=["ConstantFolding"],  # it ignores these limits
            )
            self.metadata: Mapping[str, str] = self._session.get_modelmeta().custom_metadata_map
            self.inputs = self._session.get_inputs()
            self.output_shapes = [output.shape for output in self._session.get_outputs()]
        except Exception as error:  # onnxruntime raises its own kinds, and built-in ones
            raise ModelError(f"{path}: onnxruntime cannot load it: {_in_words(error)}") from error
        if any(len(value) > _MAX_METADATA for value in self.metadata.values()):
            raise ModelError(f"{path}: has metadata of more than {_MAX_METADATA:,} characters")

    def run(self, values: Array) -> list[Array]:
        """Return all outputs for the values of the single input.

        Raises
        ------
        ModelError
            It fails, or takes too much time or memory.
        """
        options, outputs = self._new_options(), Future[list[Array]]()
        options.log_severity_level = _SILENT

        def search() -> None:
            try:
                outputs.set_result(self._session.run(None, {self.inputs[0].name: values}, options))
            except Exception as error:  # onnxruntime raises its own kinds
                outputs.set_exception(self._failed(_in_words(error)))

        # One long operation cannot be stopped: it is abandoned.
        threading.Thread(target=search, name="vdet-network", daemon=True).start()
        for _ in range(MAX_SECONDS):  # time in which this process was stopped does not count
            with suppress(TimeoutError):
                return outputs.result(1)
        options.terminate = True
        raise self._failed(f"it took more than {MAX_SECONDS} s")

    def _failed(self, reason: str) -> ModelError:
        return ModelError(f"{self.path}: fails on an image: {reason}")


def _limited_options() -> Any:
    """Return options for one thread, because frames run in parallel, and a memory limit."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.enable_mem_pattern = False  # it would reserve more than is used
    options.log_severity_level = _SILENT
    options.add_session_config_entry("session.use_env_allocators", "1")
    # External weights would be read from this folder, which cannot exist.
    folder = "session.model_external_initializers_file_folder_path"
    options.add_session_config_entry(folder, os.devnull)
    cpu = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    limit = onnxruntime.OrtArenaCfg({"max_mem": core_count() * _MAX_MEMORY})
    with suppress(Exception):  # older versions keep the first one, and raise
        onnxruntime.create_and_register_allocator(cpu, limit)
    return options


def _in_words(error: Exception) -> str:
    message = str(error)
    if "External data" in message:
        return "its weights are in other files; export it as one file"
    if "memory" in message:
        return "it takes too much memory"
    return message.partition("\n")[0][:200]
