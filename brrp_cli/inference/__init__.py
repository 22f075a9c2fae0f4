"""Inference: Hilbert-map features, the log posterior and SVGD, as pure functions on tensors."""
