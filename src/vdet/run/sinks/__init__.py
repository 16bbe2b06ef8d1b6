"""The outputs of a run, one module per output."""
