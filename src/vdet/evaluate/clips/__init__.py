"""Detection run on labelled videos, under one or many settings, and scored."""
