"""A training from files to files: labelled pictures and videos → network and metrics."""

import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.onnx.recognition import Header, read_header
from vdet.detect.onnx.session import Session
from vdet.errors import printable
from vdet.files import write_json
from vdet.learn.net.export import export_network
from vdet.learn.net.sources import Counts, Source, SourceReport, clip_source, image_source
from vdet.learn.net.training import StepProgress, train_network
from vdet.version import __version__

_AVERAGED = 100  # last steps whose mean loss is reported


@dataclass(frozen=True, slots=True)
class NetworkJob:
    """What a training reads and writes.

    Attributes
    ----------
    pictures
        Sets of labelled pictures.
    clips
        Labelled videos, each with the file of its true boxes.
    output
        The file of the network; metrics and checkpoint, the training's state, lie beside it.
    base
        An exported network from whose weights the training starts.
    overwrite
        Replace an earlier network and its metrics.
    """

    pictures: tuple[Path, ...]
    clips: tuple[tuple[Path, Path], ...]
    output: Path
    base: Path | None = None
    overwrite: bool = False

    @property
    def metrics(self) -> Path:
        """The file of the metrics."""
        return self.output.with_suffix(".json")


@dataclass(frozen=True, slots=True)
class NetworkMetrics:
    """The metrics of a training: its sources, its duration, and the mean loss of its last steps.

    `seconds` count from the last start of the training; `loss` is None if no step was left.
    """

    sources: tuple[SourceReport, ...]
    steps: int
    parameters: int
    seconds: float
    loss: float | None

    def lines(self) -> Iterator[str]:
        """Yield the metrics as lines of text."""
        loss = "" if self.loss is None else f"; loss at the end {self.loss:.3f}"
        duration = f"{self.steps:,} steps, {self.seconds / 60:.1f} minutes"
        yield f"{self.parameters:,} parameters after {duration}{loss}"


def read_sources(job: NetworkJob, settings: Settings) -> list[Source]:
    """Read all pictures of a training into memory.

    Raises
    ------
    TruthError, ImageError, VideoError
        Pictures, videos or their labels cannot be read.
    """
    sources = [image_source(path, settings) for path in job.pictures]
    return sources + [clip_source(video, truth, settings) for video, truth in job.clips]


def source_lines(reports: Sequence[SourceReport]) -> Iterator[str]:
    """Yield as lines of text what a training learns of its sources, and what not."""
    for report in reports:
        learnt = _counted(report.vehicles) or "nothing to learn"
        plural = "" if report.pictures == 1 else "s"
        yield f"{report.name}: {report.pictures:,} picture{plural}; {learnt}"
        if report.unlabelled:
            yield f"  not labelled, so not background: {', '.join(report.unlabelled)}"
        if report.ignored:
            yield f"  ignored: {_counted(report.ignored)}"
        if report.background:
            yield f"  background, as their label is unknown: {_counted(report.background)}"


def _counted(counts: Counts) -> str:
    return ", ".join(f"{count:,} {printable(name)}" for name, count in counts.items())


def train_to_file(
    job: NetworkJob, sources: Sequence[Source], settings: Settings, *, progress: StepProgress
) -> NetworkMetrics:
    """Train a network, write it with its metrics, and remove the checkpoint.

    Parameters
    ----------
    sources
        Those of `read_sources`.

    Raises
    ------
    ModelError
        The base cannot be read.
    DataError
        There is not a vehicle to learn, the base is not such a network, or the checkpoint is that
        of another training.
    OutputError
        A file cannot be written.
    """
    began = time.monotonic()
    checkpoint = job.output.with_suffix(".ckpt")
    base = read_header(Session(job.base)) if job.base else None
    learning = settings.train.net
    losses: deque[float] = deque(maxlen=_AVERAGED)

    def advance(step: int, loss: float) -> None:
        losses.append(loss)
        progress(step, loss)

    network = train_network(
        [item for item, _ in sources], learning, checkpoint, base=job.base, progress=advance
    )
    report = NetworkMetrics(
        sources=tuple(report for _, report in sources),
        steps=learning.steps,
        parameters=sum(parameter.numel() for parameter in network.parameters()),
        seconds=round(time.monotonic() - began, 1),
        loss=round(sum(losses) / len(losses), 4) if losses else None,
    )
    header = Header(
        classes=learning.classes,
        pixels=learning.width * learning.height,
        calibration=learning.score,
        provenance={
            "program": f"vdet {__version__}",
            "training": learning.model_dump(mode="json"),
            "report": asdict(report),
            **({"base": base.provenance} if base else {}),
        },
    )
    export_network(network, header, job.output, overwrite=job.overwrite)
    write_json(asdict(report), str(job.metrics), overwrite=job.overwrite)
    checkpoint.unlink(missing_ok=True)
    return report
