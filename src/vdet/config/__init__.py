"""Every tunable: typed settings, read from YAML with errors that name their place."""
