"""Damaged and wicked models through `vdet detect-image --model`."""

import io
import json
import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hostile.mutations import mutated, with_other_words
from hostile.trials import try_files
from vdet.config.kinds import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.model import FORMAT_VERSION, load_model
from vdet.errors import ModelError

FEATURES = FeatureSettings(
    patch=16, hog=HogSettings(orientations=4, cell=8, block=1), histogram=HistogramSettings(bins=8)
)
HEADER = json.dumps(
    {
        "format": "vdet model",
        "version": FORMAT_VERSION,
        "features": FEATURES.model_dump(mode="json"),
        "provenance": {"data_sha256": "0" * 64, "accuracy": 0.5},
    }
)
WORDS = (
    *("0", "-1", "1", "2", "64", "256", "1000000000", "1e999", "NaN", "Infinity", "-Infinity"),
    *("null", "true", '""', "[]", "{}", "[[[[[[]]]]]]", "9" * 5000, '"\\ud800"', "HSV"),
)
TOKENS = (*WORDS, "{", "}", "[" * 500, '"', ":", ",", "\\u0000", "\xff", "\0")
SHAPES = (
    *("(1000000000,)", "(1, 1000000000)", "(1000000000, 1000000000)", "(-1,)", "(True,)", "()"),
    *("(1.0,)", "'x'", "None", "((1,),)", "(1, 40)", "(40, 1)", "(1,)", "(0,)", "[1]", "(1, 0)"),
    "(" * 300 + ")" * 300,
)
KINDS = (
    *("<f4", ">f4", "<f8", "|O", "|S4", "<U9", "|V4", "<M8[s]", "<c8", "|b1", "a5", "x"),
    "<f4,<f4",
)
VALUES = (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e9, -1e9, 1e-45, 0.0)


def npy(array: npt.NDArray[Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npy_header(kind: str, shape: str) -> bytes:
    text = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def members(header: str | bytes = HEADER) -> dict[str, bytes]:
    """Give the parts of a model that is whole."""
    text = header if isinstance(header, bytes) else header.encode()
    ones = np.ones(1, np.float32)
    rng = np.random.default_rng(0)
    return {
        "header": npy(np.frombuffer(text, np.uint8)),
        "weights": npy(rng.normal(size=(1, FEATURES.length)).astype(np.float32)),
        "biases": npy(ones),
        "slopes": npy(-ones),
        "offsets": npy(ones),
        "box_weights": npy(rng.normal(0, 0.1, (4, FEATURES.hog_length)).astype(np.float32)),
        "box_biases": npy(np.array([-0.4, -0.3, 0.4, 0.3], np.float32)),
    }


def zipped(parts: dict[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in parts.items():
            archive.writestr(f"{name}.npy", data)
    return file.getvalue()


def bad_models() -> Iterator[bytes]:
    """Give 200 models with a fault: in the file, in a part of it, in a number, or a part less."""
    yield from mutated(zipped(members()), seed=1, count=40)
    for header in mutated(HEADER.encode(), seed=2, count=30, tokens=TOKENS):
        yield zipped(members(header))
    for header in with_other_words(HEADER, WORDS, seed=3, count=30):
        yield zipped(members(header))
    whole = members()
    for seed, name in enumerate(whole):
        for part in mutated(whole[name], seed=seed, count=8):
            yield zipped(whole | {name: part})
    rng = np.random.default_rng(4)
    names = list(whole)
    for name in names:
        yield zipped({other: part for other, part in whole.items() if other != name})
    for _ in range(20):
        name, kind = rng.choice(names), str(rng.choice(KINDS))
        data = npy_header(kind, SHAPES[rng.integers(len(SHAPES))]) + bytes(4 * FEATURES.length)
        yield zipped(whole | {name: data})
    for _ in range(17):
        name = rng.choice(names[1:])
        array = np.load(io.BytesIO(whole[name])).copy()
        array.flat[rng.integers(array.size)] = rng.choice(VALUES)
        yield zipped(whole | {name: npy(array)})


def test_damaged_models_are_used_or_refused(tmp_path: Path, picture: Path) -> None:
    contents = {f"{number}.npz": data for number, data in enumerate(bad_models())}
    assert len(contents) == 200
    use = ("detect-image", picture, "--model")
    trials = try_files(
        tmp_path, contents, lambda path, out: [*use, path, "-o", out / f"{path.stem}.png"]
    )
    assert 8 < sum(trial.code == 0 for trial in trials) < 100


def bombs() -> dict[str, tuple[dict[str, bytes], str]]:
    whole = members()
    billion = npy_header("<f4", "(1, 1000000000)")
    hog = {"orientations": 32, "cell": 2, "block": 8}
    many = FEATURES.model_dump(mode="json") | {"patch": 256, "halved": [], "hog": hog}
    asking = json.dumps(json.loads(HEADER) | {"features": many})
    damaged = "is not a vdet model, or is damaged"
    return {
        "a billion features, claimed": (whole | {"weights": billion + bytes(100)}, damaged),
        "as many, packed": (whole | {"weights": billion + bytes(65_000_000)}, "is too large"),
        "ninety million, asked for": (members(asking), r"weights .* not of shape \(1, 89\d{6}\)"),
        "a header like a book": (members('{"a": ' * 100_000), damaged),
    }


BOMBS = bombs()


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_rejected(tmp_path: Path, name: str) -> None:
    parts, words = BOMBS[name]
    path = tmp_path / "model.npz"
    path.write_bytes(zipped(parts))
    with pytest.raises(ModelError, match=words):
        load_model(path)
