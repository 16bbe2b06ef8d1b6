"""The fast engine: each strip of a frame is described once for all the windows in it.

`strips` cuts and shrinks strips, `hog` describes them and sums weighted blocks window by window,
`histogram` does the same for colours, `aligned` searches grids that step by whole cells, `located`
the others, `engine` chooses.
"""

from vdet.detect.svm.dense.engine import dense_search, why_not_dense

__all__ = ["dense_search", "why_not_dense"]
