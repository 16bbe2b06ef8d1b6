"""Many videos in one go: inputs → plan → run → manifest. One bad file never stops the rest."""
