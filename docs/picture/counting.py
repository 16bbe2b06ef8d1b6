"""Make docs/counts.jpg: count on the road of the demo."""

import subprocess
import sys
from pathlib import Path

from vdet.demo import LINES, SEED
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.synthetic import demo_scene, write_clip

FRAME = 172  # a vehicle has overtaken on the right


def counted_frame(folder: Path) -> Image:
    """Draw the road of the demo, count on it, and return a frame of the video with the counts."""
    road, lines, video = (folder / name for name in ("road.mp4", "lines.yaml", "counted.mp4"))
    write_clip(road, demo_scene(SEED))
    lines.write_text(LINES, encoding="utf-8")
    settings = ("draw.trails=3", "draw.time=true", "output.crf=6")
    words = [word for each in settings for word in ("--set", each)]
    program = [sys.executable, "-m", "vdet", "detect-video", road, video, "--lines", lines]
    subprocess.run([*program, *words], check=True)
    with VideoReader(video) as reader:
        return next(frame.image for frame in reader if frame.index == FRAME)
