"""Flows and speeds of drawn pole cameras, with their true boxes: all thirty are a benchmark."""

import pytest
from benchmarks.pole_cameras import measured, pole_scene


@pytest.mark.parametrize(("kind", "above"), [("turning", 8.0), ("queue", 6.0), ("lorries", 10.0)])
def test_flows_are_exact_and_speeds_right(kind: str, above: float) -> None:
    scene = pole_scene(kind, above, seed=1)
    truth = list(scene.true_tracks(every=2))
    found = measured(scene, truth, truth)
    assert len(found.flows) >= 2
    assert found.exact == len(found.flows), found.flows
    assert found.near >= 0.95 * len(found.speeds) - 1
