"""Reviews of saved tracks: the video is read again, but not searched."""

from pathlib import Path

from vdet.boxes import NO_BOXES
from vdet.errors import VideoError
from vdet.files import OutputFiles
from vdet.findings import Findings
from vdet.media.reader import VideoReader
from vdet.progress import Progress
from vdet.run.result import FINDINGS, FrameResult, findings_in
from vdet.run.scene import saved_frames
from vdet.run.sinks.protocol import SinkContext, check_sinks, open_sinks
from vdet.run.video import Run, log
from vdet.track.track import FrameTracks
from vdet.traffic.live import LiveTraffic


def write_saved_review(run: Run, tracks: Path, progress: Progress) -> None:
    """Write the outputs of a run from the file `tracks`, without detecting vehicles.

    Raises `VdetError` if the video or the tracks cannot be used, or an output cannot be written.
    """
    settings = run.settings
    files = OutputFiles(overwrite=run.overwrite, inputs=run.inputs, is_last=True)
    check_sinks(run.outputs, files)
    with (
        VideoReader(run.source, start=run.start, end=run.end, settings=settings.input) as reader,
        files,
    ):
        info = reader.info
        scene = saved_frames(tracks, run, (info.width, info.height), info)
        frames = {frame.index: frame for frame in scene.frames}
        traffic = LiveTraffic(settings, info.width, info.height)
        context = SinkContext(files, settings, info, is_part=run.is_part, traffic=traffic)
        advance = progress("", reader.expected)
        count = 0
        with open_sinks(run.outputs, context) as sinks:
            for frame in reader:
                saved = frames.get(frame.index, FrameTracks(frame.index, float(frame.time), ()))
                traffic.add(saved)
                result = FrameResult(run.source, frame, NO_BOXES, saved.tracks, searched=False)
                sinks.write(result.of_classes(settings.classes))
                advance(1)
                count += 1
            if not count:
                raise VideoError(f"{run.source}: no frames at these times; check them")
            traffic.end(Findings(scene.findings))
            if counts := traffic.counts():
                context.facts[FINDINGS] = Findings(counts.findings)
        for warning in str(findings_in(context.facts)).splitlines():
            log.warning("%s: %s", run.source, warning)
