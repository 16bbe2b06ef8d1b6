"""Every odd but legal clip is processed whole: each frame, upright, at its time, and the sound."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clips import MILLISECOND, ODD, RED, read_number, times_of, write_clip
from strange.conftest import Process

CLIPS: dict[str, tuple[str, dict[str, Any]]] = ODD | {
    "2160p": ("mp4", {"size": (3840, 2160), "count": 2, "options": {"preset": "ultrafast"}}),
    "two sounds in mkv": ("mkv", {"sounds": ["libopus", "libmp3lame"]}),
    "sound in webm": ("webm", {"codec": "libvpx", "sounds": ["libopus"]}),
    "sound in a transport stream": ("ts", {"sounds": ["aac"]}),
    "sound longer, in mkv": ("mkv", {"sounds": ["aac"], "sound_seconds": 2}),
    "avi with sound, into mkv": ("avi", {"codec": "mpeg4", "sounds": ["pcm_s16le"]}),
}


@pytest.mark.parametrize("name", CLIPS)
def test_every_frame_comes_out_at_its_time_upright_and_with_its_sound(
    name: str, tmp_path: Path, process: Process
) -> None:
    suffix, spec = CLIPS[name]
    source = write_clip(tmp_path / f"clip.{suffix}", **spec)
    shown = process(source, suffix="mkv" if "mkv" in name else "mp4")
    expected = times_of(spec)
    assert [read_number(image) for image in shown.images] == list(range(len(expected)))
    offsets = [abs(a - b) for a, b in zip(shown.times, expected, strict=True)]
    assert max(offsets) <= MILLISECOND
    width, height = spec.get("size", (160, 96))
    for image in shown.images:
        assert image.shape == (height + height % 2, width + width % 2, 3)
        corner = image[height * 5 // 8 : height * 7 // 8, width // 8 : width * 3 // 8]
        if spec.get("pix_fmt") == "gray":
            assert np.ptp(corner.mean(axis=(0, 1))) < 2
        else:
            assert np.abs(corner.mean(axis=(0, 1)) - RED).max() < (25 if suffix == "gif" else 8)
    assert len(shown.sounds) == len(spec.get("sounds", []))
    seconds = spec.get("sound_seconds", float(expected[-1]))
    assert all(packets > 30 * seconds for packets in shown.sounds.values())
    assert shown.warnings == []
