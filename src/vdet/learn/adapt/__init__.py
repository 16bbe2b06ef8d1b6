"""Footage of one camera → a linear model that knows it, without a label drawn.

`footage` lets a teacher watch the clips, `labels` makes labels of what it finds, `windows` fits the
window sets, `student` fits the model to the patches that `vdet.learn.mining` cuts out, and `check`
measures it in footage that was kept back. `run` does all this in turn.
"""
