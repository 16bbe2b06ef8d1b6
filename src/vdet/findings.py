"""Findings: reasons to doubt a result, when they apply, and how much."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import pydantic
from pydantic import AliasChoices, Field

Severity = Literal["warning", "note", "fact"]
AT_LINES = "corrections", "frame-rate", "ground", "line", "traces"
"""Codes of findings about counts and speeds, which other lines may not have."""


@pydantic.dataclasses.dataclass(frozen=True, slots=True)
class Finding:
    """A reason to doubt a result, also as a file of tracks says it.

    Attributes
    ----------
    code
        Its name; `conditions.ignore` suppresses findings by it.
    text
        A sentence: what was found, and what it means.
    spans
        When it applies, in order; empty for the whole video.
    severity
        "warning": the result may be wrong. "note": for information. "fact": kept in tracks, because
        it is a warning where there are lines, zones, regions or ground points: see `at_places`.
    value
        A measure, if there is one: fraction of the frame's width, of the motion, or of the vehicles
        that the network finds.
    """

    code: str
    text: str
    spans: tuple[tuple[float, float], ...] = Field(
        default=(), validation_alias=AliasChoices("times", "spans")
    )
    severity: Severity = "warning"
    value: float | None = None

    def __str__(self) -> str:
        return f"{self.text} [{self.code}]"

    def record(self) -> dict[str, Any]:
        """Return it as values for JSON; times are rounded to milliseconds."""
        times = [[round(first, 3), round(last, 3)] for first, last in self.spans]
        value = None if self.value is None else round(self.value, 3)
        values = {"code": self.code, "severity": self.severity, "text": self.text}
        return values | {"times": times, "value": value}


def warnings_in(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return those by which a result may be wrong."""
    return tuple(finding for finding in findings if finding.severity == "warning")


def without(findings: Iterable[Finding], codes: Collection[str]) -> tuple[Finding, ...]:
    """Return the findings that do not have one of these codes."""
    return tuple(finding for finding in findings if finding.code not in codes)


def with_counted(of_tracks: Iterable[Finding], of_counts: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings of tracks, and those of counts that do not repeat them."""
    first = tuple(of_tracks)
    said = {item.code for item in first} & {"nothing-found"}
    return first + tuple(item for item in without(of_counts, said) if item not in first)


def at_places(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings where lines, zones, regions or ground points are used."""
    return tuple(
        replace(item, severity="warning") if item.severity == "fact" else item for item in findings
    )


@dataclass(frozen=True, slots=True)
class Findings:
    """The reasons to doubt the results of a video.

    Attributes
    ----------
    items
        All findings.
    is_still
        Whether the camera stood still.
    facts
        What is a finding only at other settings.
    """

    items: tuple[Finding, ...] = ()
    is_still: bool = False
    facts: tuple[Finding, ...] = ()

    def record(self) -> list[dict[str, Any]]:
        """Return them as values for JSON."""
        return [finding.record() for finding in self.items]

    def __str__(self) -> str:
        return "\n".join(map(str, warnings_in(self.items)))
