"""The loop frame → detector → tracker → sinks."""
