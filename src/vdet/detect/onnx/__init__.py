"""Networks in ONNX files as detectors: our own, and those that the usual tools export."""
