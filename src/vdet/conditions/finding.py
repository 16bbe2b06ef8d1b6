"""A finding: a reason to doubt a result, when it applies, and how much."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from vdet.config.schema import Code
from vdet.errors import clock_text
from vdet.traffic.clock import Span, extend

Severity = Literal["warning", "note"]
_GAP = 2.0
"""Maximum seconds between two times of one span."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A reason to doubt a result.

    Attributes
    ----------
    code
        Its name; `conditions.ignore` suppresses findings by it.
    text
        A sentence: what was found, and what it means.
    spans
        When it applies, in order; empty for the whole video.
    severity
        "warning": the result may be wrong. "note": for information.
    value
        A measure, if there is one: fraction of the frame's width, of the motion, or of the vehicles
        that the network finds.
    """

    code: Code
    text: str
    spans: tuple[Span, ...] = ()
    severity: Severity = "warning"
    value: float | None = None

    def record(self) -> dict[str, Any]:
        """Return it as values for JSON; times are rounded to milliseconds."""
        times = [[round(first, 3), round(last, 3)] for first, last in self.spans]
        value = None if self.value is None else round(self.value, 3)
        values = {"code": self.code, "severity": self.severity, "text": self.text}
        return values | {"times": times, "value": value}


@dataclass(frozen=True, slots=True)
class Findings:
    """The reasons to doubt the results of a video.

    Attributes
    ----------
    items
        All findings.
    is_still
        Whether the camera stood still.
    """

    items: tuple[Finding, ...] = ()
    is_still: bool = False

    @property
    def is_doubtful(self) -> bool:
        """Whether a result may be wrong."""
        return any(finding.severity == "warning" for finding in self.items)

    def record(self) -> list[dict[str, Any]]:
        """Return them as values for JSON."""
        return [finding.record() for finding in self.items]

    def __str__(self) -> str:
        warnings = (finding for finding in self.items if finding.severity == "warning")
        return "\n".join(f"{finding.text} [{finding.code}]" for finding in warnings)


def joined(times: Iterable[float], shortest: float = 0.0) -> list[Span]:
    """Join ascending times that are close together into spans; omit spans that are too short."""
    spans: list[Span] = []
    for time in times:
        extend(spans, time, _GAP)
    return [(first, last) for first, last in spans if last - first >= shortest]


def when(spans: Sequence[Span]) -> str:
    """Return "from 0:05 to 0:32"; for several spans, the longest and the number of others."""
    first, last = max(spans, key=lambda span: span[1] - span[0])
    more = f" (and {len(spans) - 1} more)" if len(spans) > 1 else ""
    return f"from {clock_text(int(first))} to {clock_text(int(last))}{more}"
