"""Descriptors of shape and colour: FPFH, colour histograms, point pairs, metric extents."""
