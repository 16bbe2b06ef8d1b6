"""How well the classifier separates patches of vehicles from others."""

from vdet.learn.svm.patch_eval.evaluate import PatchReport, evaluate_model, evaluate_splits
from vdet.learn.svm.patch_eval.trials import SPLITS

__all__ = ["SPLITS", "PatchReport", "evaluate_model", "evaluate_splits"]
