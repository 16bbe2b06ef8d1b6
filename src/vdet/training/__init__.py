"""Patches → split, scale, fit, calibrate → a model and a report on it."""

from vdet.training.report import TrainingReport
from vdet.training.training import train

__all__ = ["TrainingReport", "train"]
