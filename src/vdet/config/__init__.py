"""The settings: typed, read from YAML, with errors that name their place."""
