"""How well vehicles are found and followed: truth readers and the metrics of the trade."""
