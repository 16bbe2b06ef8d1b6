"""How well the classifier tells patches of vehicles from others."""

from vdet.learn.patch_eval.evaluate import evaluate_model, evaluate_splits
from vdet.learn.patch_eval.results import PatchReport
from vdet.learn.patch_eval.trials import SPLITS, SplitName

__all__ = ["SPLITS", "PatchReport", "SplitName", "evaluate_model", "evaluate_splits"]
