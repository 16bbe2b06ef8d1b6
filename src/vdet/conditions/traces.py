"""Findings about traces: what passed a line, but was not counted."""

from collections import Counter

from vdet.conditions.finding import Finding
from vdet.errors import clock_text, counted
from vdet.traffic.counts import Counts

_MANY = 0.05
"""Maximum number of traces for a note instead of a warning, as a fraction of the vehicles."""
_INTERVAL = 300
"""Seconds of the intervals in which traces are counted."""


def trace_findings(counts: Counts) -> tuple[Finding, ...]:
    """Return a finding for each line or zone with traces; a single trace is a note."""
    vehicles = Counter(event.name for event in counts.events)
    findings = []
    for name, number in Counter(trace.name for trace in counts.traces).items():
        times = [trace.time for trace in counts.traces if trace.name == name]
        starts = Counter(int(time // _INTERVAL) * _INTERVAL for time in times)
        [(start, most)] = starts.most_common(1)
        text = (
            f"{name}: {counted(number, 'trace')} without a vehicle, and {vehicles[name]} counted; "
            f"{clock_text(start)} to {clock_text(start + _INTERVAL)}: {most}"
        )
        fraction = number / max(1, vehicles[name])
        is_many = number > 1 and fraction > _MANY
        spans = tuple((time, time) for time in times)
        findings.append(Finding("traces", text, spans, "warning" if is_many else "note", fraction))
    return tuple(findings)
