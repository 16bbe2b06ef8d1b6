"""Pages that show results: HTML files that need no network."""
