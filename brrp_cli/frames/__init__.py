"""Frames: what a camera saw, checked, and what is sampled from it."""
