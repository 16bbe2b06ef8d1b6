"""`vdet detect-video --threads`: faster, and never different."""

import json
from pathlib import Path

from conftest import Run

# Cars are shown sooner: the clip is short.
SOON = ("--set", "tracker.confirm_seconds=0.04")


def test_tracks_are_the_same_whatever_the_threads_and_at_every_run(
    run: Run, clip_path: Path, tmp_path: Path
) -> None:
    texts = []
    for number, threads in enumerate((1, 1, 3, 3)):
        tracks = tmp_path / f"{number}.jsonl"
        options = ("--no-video", "--tracks", tracks, *SOON)
        result = run("detect-video", clip_path, *options, "--threads", str(threads))
        assert result.code == 0, result.err
        texts.append(tracks.read_text())
    records = [json.loads(line) for line in texts[0].splitlines()]
    assert any(record["tracks"] for record in records), "nothing found: the test would say nothing"
    assert [record["frame"] for record in records] == list(range(30))
    assert texts[1:] == texts[:1] * 3
