"""A video that is decoded and encoded, and nothing else: what runs are compared with."""

import itertools
from pathlib import Path

import av
from av.video.frame import PictureType

OPTIONS = {"preset": "superfast", "crf": "25"}
"""Those of the default settings."""


def transcode(path: Path, out: Path, frames: int) -> None:
    """Encode the planes of the first frames as they are decoded."""
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = source.streams.video[0]
        stream.thread_type = "AUTO"
        encoder = target.add_stream("libx264", rate=stream.average_rate, options=OPTIONS)
        encoder.width, encoder.height = stream.width, stream.height
        for frame in itertools.islice(source.decode(stream), frames):
            frame.pict_type = PictureType.NONE  # the encoder chooses its own
            target.mux(encoder.encode(frame))
        target.mux(encoder.encode())
