"""Make docs/counts.jpg: count on the road of the demo, whose model has learnt drawn patches."""

import subprocess
import sys
from pathlib import Path

from vdet.media import VideoReader
from vdet.media.images import Image

LINES = """\
lines:
  - {name: right lanes, start: [0.54, 0.82], end: [0.97, 0.82], left: ahead, right: back}
"""
FRAME = 158  # a vehicle has overtaken on the right


def counted_frame(folder: Path) -> Image:
    """Run `vdet demo`, count on its road, and return a frame of the video with the counts."""
    demo, lines, video = folder / "demo", folder / "lines.yaml", folder / "counted.mp4"
    lines.write_text(LINES, encoding="utf-8")
    program = [sys.executable, "-m", "vdet"]
    subprocess.run([*program, "demo", demo], check=True)
    settings = ("counts.drawn=true", "draw.trails=3", "draw.time=true", "output.crf=6")
    words = [word for each in settings for word in ("--set", each)]
    model = ("--model", demo / "model.npz", "--lines", lines)
    subprocess.run([*program, "detect-video", demo / "road.mp4", video, *model, *words], check=True)
    with VideoReader(video) as reader:
        return next(frame.image for frame in reader if frame.index == FRAME)
