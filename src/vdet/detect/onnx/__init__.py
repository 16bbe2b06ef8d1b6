"""Networks in ONNX files as detectors: our own, and exports of common tools."""
