import pytest

from vdet.config.loading import load_settings
from vdet.errors import ConfigError
from vdet.evaluate.clips.sweep import grid, with_values_in_force


def test_without_sweeps_there_is_one_setting() -> None:
    assert grid(()) == [()]


def test_the_values_of_a_key_in_their_order() -> None:
    assert grid(("detector.heat.threshold=4,1, 2",)) == [
        ("detector.heat.threshold=4",),
        ("detector.heat.threshold=1",),
        ("detector.heat.threshold=2",),
    ]


def test_several_keys_make_a_grid() -> None:
    assert grid(("a=1,2", "b=x,y")) == [
        *(("a=1", "b=x"), ("a=1", "b=y")),
        *(("a=2", "b=x"), ("a=2", "b=y")),
    ]


def test_a_comma_in_brackets_belongs_to_the_value() -> None:
    values = "detector.search.windows=[{size: 64, top: 1}],[{size: 96, top: 2}]"
    assert grid((values,)) == [
        ("detector.search.windows=[{size: 64, top: 1}]",),
        ("detector.search.windows=[{size: 96, top: 2}]",),
    ]


def test_a_value_given_twice_is_run_once() -> None:
    assert grid(("a=1,1",)) == [("a=1",)]


@pytest.mark.parametrize("text", ["heat.threshold", "=1,2", "a=", "a=1,,2", "a=1,"])
def test_other_text_than_a_sweep_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="expected KEY=VALUE,VALUE"):
        grid((text,))


def test_a_key_swept_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="--sweep a: is given twice"):
        grid(("a=1,2", "b=1", "a=3"))


@pytest.mark.parametrize(
    ("sweep", "expected"),
    [
        ("tracker.needed=0.2,0.3", "tracker.needed=0.1,0.2,0.3"),
        ("tracker.needed=0.2, 1e-1", "tracker.needed=0.2, 1e-1"),
        ("detector.heat.regions=outline", "detector.heat.regions=votes,outline"),
        ("output.crf=1", "output.crf=30,1"),
        ("train.svm.augmentation.mirror=no", "train.svm.augmentation.mirror=true,no"),
        ("detector.search.perspective.sizes.0=0.2", "detector.search.perspective.sizes.0=0.1,0.2"),
        ("detector.features={patch: 64}", "detector.features={patch: 64}"),
        ("no.such=1", "no.such=1"),
    ],
)
def test_the_value_in_force_is_always_compared(sweep: str, expected: str) -> None:
    given = ["output.crf=30", "detector.search.perspective.sizes=[0.1]"]
    settings = load_settings(None, given, detector="svm")
    assert with_values_in_force([sweep], settings) == [expected]
