"""How well the classifier tells patches of vehicles from others."""

from vdet.evaluation.patches.evaluate import evaluate_model, evaluate_splits
from vdet.evaluation.patches.results import PatchReport
from vdet.evaluation.patches.trials import SPLITS, SplitName

__all__ = ["SPLITS", "PatchReport", "SplitName", "evaluate_model", "evaluate_splits"]
