"""Tracks as `vdet detect-video --tracks` writes them, read back."""

from vdet.evaluate.predictions.read import read_predictions

__all__ = ["read_predictions"]
