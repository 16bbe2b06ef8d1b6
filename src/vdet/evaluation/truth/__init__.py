"""Truth as the benchmarks and the labelling tools write it."""

from vdet.evaluation.truth.read import read_truth

__all__ = ["read_truth"]
