"""A network in an ONNX file as the kind of detector `net`."""

from pathlib import Path

from vdet.config.schema import NetworkSettings
from vdet.detect.factory import DetectorKind
from vdet.detect.onnx.detector import NetworkModel

SHIPPED = Path(__file__).parents[2] / "models" / "net.onnx"


def load_network(settings: NetworkSettings, path: Path | None) -> NetworkModel:
    """Load a network; `path` is its file, None for the shipped one.

    Raises
    ------
    ModelError
        The file cannot be used, or onnxruntime is not installed.
    """
    return NetworkModel(path or SHIPPED, settings)


NET = DetectorKind(NetworkSettings, load_network, lambda _: SHIPPED)
