"""Truth as the benchmarks and the labelling tools write it."""

from vdet.evaluate.truth.read import read_truth

__all__ = ["read_truth"]
