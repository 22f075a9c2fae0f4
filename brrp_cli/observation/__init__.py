"""Observation: the support plane, and what a frame says of occupied and free space."""
