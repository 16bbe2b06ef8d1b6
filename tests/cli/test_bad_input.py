"""What bad input gets: one line that says what to do, exit code 1, and nothing half-written."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest

from conftest import Run
from quick import only_windows
from vdet.detect.svm.model import load_model, save_model


def _failure(run: Run, source: Path, out: Path, *options: str | Path) -> str:
    """Run detect-video, expect one line of error and no output; return the line."""
    result = run("detect-video", source, out, "--tracks", out.with_suffix(".csv"), *options)
    assert result.code == 1
    assert result.err.count("\n") == 1, result.err
    assert "Traceback" not in result.err
    assert not out.exists()
    assert not out.with_suffix(".csv").exists()
    assert not list(out.parent.glob(".*")), "a temporary file was left"
    return result.err


@pytest.fixture
def out(tmp_path: Path) -> Path:
    folder = tmp_path / "out"
    folder.mkdir()
    return folder / "out.mp4"


def test_a_video_that_is_not_there(run: Run, out: Path) -> None:
    assert "no such file" in _failure(run, out.parent / "none.mp4", out)


def test_a_folder_for_a_video(run: Run, tmp_path: Path, out: Path) -> None:
    assert "is a folder" in _failure(run, tmp_path, out)


@pytest.mark.parametrize("content", [b"", b"This is no video.\n" * 50])
def test_a_text_file_named_mp4(run: Run, tmp_path: Path, out: Path, content: bytes) -> None:
    source = tmp_path / "text.mp4"
    source.write_bytes(content)
    assert "text.mp4: is not a video" in _failure(run, source, out)


def test_a_video_without_a_picture_stream(run: Run, tmp_path: Path, out: Path) -> None:
    source = tmp_path / "sound.mp4"
    with av.open(str(source), "w") as container:
        stream = container.add_stream("aac", rate=8000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    assert "sound.mp4" in _failure(run, source, out)


def test_a_video_cut_off_before_its_index(
    run: Run, clip_path: Path, tmp_path: Path, out: Path
) -> None:
    source = tmp_path / "cut.mp4"
    with av.open(str(clip_path)) as whole, av.open(str(source), "w") as copy:  # index last
        stream = copy.add_stream_from_template(whole.streams.video[0])
        for packet in whole.demux(video=0):
            if packet.size:
                packet.stream = stream
                copy.mux(packet)
    data = source.read_bytes()
    source.write_bytes(data[: len(data) // 2])
    assert "cut.mp4: is not a video, or one that was cut off" in _failure(run, source, out)


def test_a_video_cut_off_in_the_middle_gives_what_is_left(
    run: Run, clip_path: Path, model_path: Path, tmp_path: Path, out: Path
) -> None:
    data = clip_path.read_bytes()
    source = tmp_path / "cut.mp4"
    source.write_bytes(data[: len(data) * 2 // 3])
    few = only_windows("size: 160, overlap: 0.5, top: 380, bottom: 600")
    few += ("--set", "input.max_damaged=0.1")  # one frame is damaged where the file ends
    result = run("detect-video", source, out, "--model", model_path, *few)
    assert result.code == 0, result.err
    assert "ends early: " in result.err
    with av.open(str(out)) as container:
        assert 5 < sum(1 for _ in container.decode(video=0)) < 30


Damage = Callable[[Path, Path], None]


def _truncate(model: Path, target: Path) -> None:
    data = model.read_bytes()
    target.write_bytes(data[: len(data) // 2])


def _text(_: Path, target: Path) -> None:
    target.write_text("weights")


def _not_a_number(model: Path, target: Path) -> None:
    good = load_model(model)
    weights = good.weights.copy()
    weights[0, 7] = np.nan
    save_model(replace(good, weights=weights), target)


def _other_features(model: Path, target: Path) -> None:
    good = load_model(model)
    save_model(replace(good, weights=good.weights[:, :-96]), target)


def _other_version(model: Path, target: Path) -> None:
    arrays = dict(np.load(model))
    header = json.loads(arrays["header"].tobytes()) | {"version": 9}
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(target, **arrays)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (_truncate, "is not a vdet model, or is damaged"),
        (_text, "is not a vdet model, or is damaged"),
        (_not_a_number, "hold a value that is not a number"),
        (_other_features, "its features need (1, 4800)"),
        (_other_version, "is a model of version 9"),
        (lambda *_: None, "cannot be read: No such file"),
    ],
)
def test_a_model_that_cannot_be_used(
    run: Run,
    clip_path: Path,
    model_path: Path,
    tmp_path: Path,
    out: Path,
    damage: Damage,
    words: str,
) -> None:
    bad = tmp_path / "bad.npz"
    damage(model_path, bad)
    line = _failure(run, clip_path, out, "--model", bad)
    assert "bad.npz" in line
    assert words in line


def test_settings_that_ask_for_other_features(
    run: Run, clip_path: Path, model_path: Path, out: Path
) -> None:
    options = ("--model", model_path, "--set", "detector.features.color_space=HSV")
    line = _failure(run, clip_path, out, *options)
    assert (
        "was trained with other features (detector.features.color_space: YCrCb, asked for HSV)"
        in line
    )
