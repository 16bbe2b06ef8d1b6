"""A frame's windows and the probability that each shows a vehicle."""
