"""A network in an ONNX file as the kind of detector `net`."""

from pathlib import Path

from vdet.config.schema import NetworkSettings
from vdet.detect.factory import DetectorKind
from vdet.detect.onnx.detector import NetworkModel
from vdet.detect.onnx.recognition import read_header
from vdet.detect.onnx.session import Session

SHIPPED = Path(__file__).parents[2] / "models" / "net.onnx"


def load_network(settings: NetworkSettings, path: Path | None) -> NetworkModel:
    """Load a network; `path` is its file, None for the shipped one.

    Raises
    ------
    ModelError
        The file cannot be used, or onnxruntime is not installed.
    """
    return NetworkModel(path or SHIPPED, settings)


def trained_on(path: Path) -> tuple[str, ...]:
    """Return the names of the sets that a network of ours was trained on; of others, nothing.

    Those of the networks that it was trained from are among them.
    """
    header = read_header(Session(path), path)
    provenance = header.provenance if header else None
    names: list[str] = []
    try:
        while provenance:
            names += (str(source["name"]) for source in provenance["report"]["sources"])
            provenance = provenance.get("base")
    except (LookupError, TypeError, AttributeError):
        return ()
    return tuple(dict.fromkeys(names))


NET = DetectorKind(NetworkSettings, load_network, lambda _: SHIPPED, trained_on)
