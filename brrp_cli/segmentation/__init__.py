"""Segmentation: object masks from depth and colour, without a model or by a phrase."""
