"""Patches → split, scale, fit, calibrate → a model and a report on it."""

from vdet.training.extraction import LabelledVectors, extract
from vdet.training.fitting import fit
from vdet.training.report import SplitReport, TrainingReport
from vdet.training.training import train

__all__ = ["LabelledVectors", "SplitReport", "TrainingReport", "extract", "fit", "train"]
