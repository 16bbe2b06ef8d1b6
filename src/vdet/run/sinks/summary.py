"""The sink `summary`: a record of each vehicle, as `.csv` or `.json`.

Times are in seconds and those of the input; pixels are those of the input frame, counted from 0.
"""

from pathlib import Path
from typing import Any, Self

from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import BatchTotal, SinkContext, SinkKind
from vdet.traffic.record_files import SUFFIXES, join_records, write_records
from vdet.traffic.records import VehicleRecords


class SummarySink:
    """Keeps a record of each vehicle, and writes all at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        assert context.video is not None  # `takes` says so
        self._path = path
        self._context = context
        self._records = VehicleRecords(context.video.width)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: Any, *_: object) -> None:
        if kind is None:
            write_records(self._records.end(), self._context.files.stage(self._path))

    def write(self, result: FrameResult) -> None:
        """Add a frame."""
        self._records.add(result.frame_tracks)


SUMMARY = SinkKind(
    SummarySink, SUFFIXES, "summaries", takes="videos", total=BatchTotal("all", join_records)
)
