"""Findings about traces: what passed a line, but was not counted."""

from collections import Counter

from vdet.conditions.finding import Finding, Severity
from vdet.errors import clock_text, counted
from vdet.traffic.counts import Counts

_MANY = 0.05
"""Maximum number of traces without a warning, as a fraction of the counted vehicles."""
_FEWEST = 2
"""Minimum number of traces for a warning."""


def trace_findings(counts: Counts, interval: int) -> list[Finding]:
    """Return a finding for each line or zone that has traces; `interval` is in seconds."""
    vehicles = Counter(event.name for event in counts.events)
    findings = []
    for name, number in Counter(trace.band.name for trace in counts.traces).items():
        times = (trace.time for trace in counts.traces if trace.band.name == name)
        by_interval = Counter(int(time // interval) * interval for time in times)
        (start, most), *_ = by_interval.most_common(1)
        fraction = number / max(1, vehicles[name])
        is_many = number >= _FEWEST and fraction > _MANY
        text = (
            f"{name}: {counted(number, 'trace')} without a vehicle, {most} of them from "
            f"{clock_text(start)} to {clock_text(start + interval)}; "
            f"{counted(vehicles[name], 'vehicle')} counted"
        )
        spans = tuple((float(first), float(first + interval)) for first in sorted(by_interval))
        severity: Severity = "warning" if is_many else "note"
        findings.append(Finding("traces", text, spans, severity, fraction))
    return findings
