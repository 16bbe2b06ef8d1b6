"""`--clips`: which fraction of a run cuts the clips, beyond the search.

    python -m benchmarks.clips [MINUTES]

The video is a synthetic road from a pole with traffic in a fifteenth of its time, as an hour with
four minutes of traffic, in two parts. `MINUTES` is 4 by default.
"""

import sys
import tempfile
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from unittest.mock import patch

from vdet.config.schema import ClipSettings, OutputSettings, Settings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.writer import VideoWriter
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.sinks.folders import ClipSink
from vdet.run.video import Run, run_video
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import pole_scene

PARTS = 15
"""One of so many parts of the video has traffic."""


def write_video(path: Path, minutes: float) -> None:
    """Write the video: the traffic of a scene comes at a third, and again at two thirds of it."""
    scene = pole_scene(1)
    empty = Renderer(replace(scene, vehicles=())).image(0)
    frames, busy = round(60 * minutes * scene.rate), round(30 * minutes * scene.rate / PARTS)
    images = [Renderer(scene).image(index % scene.frames) for index in range(busy)]
    info = VideoInfo(path, scene.camera.width, scene.camera.height, scene.rate, 1 / scene.rate)
    with VideoWriter(path, info, OutputSettings(), name=path) as writer:
        for index in range(frames):
            since = min((index - begin for begin in (frames // 3, 2 * frames // 3)), key=abs)
            image = images[since] if 0 <= since < busy else empty
            writer.write(Frame(index, Fraction(index) / scene.rate, Picture(image)))


def seconds_of_run(run: Run, model: DetectorModel) -> tuple[float, float]:
    """Return the processor time of a whole run, and of cutting its clips."""
    cut, finish = 0.0, ClipSink.finish

    def timed(sink: ClipSink) -> None:
        nonlocal cut
        begin = time.process_time()
        finish(sink)
        cut = time.process_time() - begin

    begin = time.process_time()
    with patch.object(ClipSink, "finish", timed):
        run_video(run, Parts(model))
    return time.process_time() - begin, cut


def main() -> None:
    minutes = float(sys.argv[1]) if sys.argv[1:] else 4.0
    model = load_detector(Settings().detector)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "road.mp4"
        write_video(path, minutes)
        for exact in (False, True):
            settings = Settings(clips=ClipSettings(exact=exact))
            clips = Output("clips", path.with_name(f"clips-{exact}"))
            whole, cut = seconds_of_run(Run(path, (clips,), settings), model)
            names = sorted(file.name for file in clips.path.iterdir())
            print(
                f"exact={exact}: {cut:.2f} of {whole:.2f} s of a core, {cut / whole:.1%}; {names}"
            )


if __name__ == "__main__":
    main()
