"""The outputs of a run, one file an output."""
