"""Segmentation: object masks from depth and colour, of what stands on a table or by a phrase."""
