"""The dense and the patch engine give nearly the same results for the same windows."""

import pytest

from detect.svm.engine_comparison import (
    SEED_FEATURES,
    EngineResults,
    cars,
    compare,
    fitted,
    grid_of,
    road,
)
from seed import SEED
from vdet.config.schema import SvmSettings
from vdet.detect.svm.windows import window_grids

SHIPPED = {"seed": SEED.svm, "default": SvmSettings()}
GRIDS = {
    "a cell": grid_of(64, overlap=0.875),
    "two cells": grid_of(96, overlap=0.75),
    "three cells": grid_of(64, overlap=0.625),
    "one and a half": grid_of(64, overlap=0.8),
    "half pixels": grid_of(128, overlap=0.8),
    "third pixels": grid_of(96, overlap=0.8),
    "enlarged": grid_of(48, overlap=0.8),
    "enlarged, third pixels": grid_of(48, overlap=0.85),
}
HORIZON = 0.57
"""Row of the horizon of the drawn road."""

FEW = 0.92
"""Minimum fraction of equal decisions in a small grid, where a few near 0.5 are some percent."""


def assert_agree(results: EngineResults, same: float = 0.97) -> None:
    assert (results.patch > 0).any(), "nothing is found: decisions cannot differ"
    assert results.correlation >= 0.99
    assert results.same >= same


@pytest.mark.parametrize(("name", "members"), [("seed", 3), ("default", 1), ("default", 3)])
def test_the_engines_agree_on_a_drawn_road(name: str, members: int) -> None:
    model = fitted(SHIPPED[name].features, members)
    grids = window_grids(SHIPPED[name], model.features, 1280, 720, horizon=HORIZON)
    assert_agree(compare(model, grids, road()))


@pytest.mark.parametrize("kind", GRIDS)
def test_the_engines_agree_for_any_step(kind: str) -> None:
    model = fitted(SEED_FEATURES, members=2)
    assert_agree(compare(model, [GRIDS[kind]], cars()), same=FEW)
