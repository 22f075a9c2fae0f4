"""Procedural tabletop scenes: models, physics, camera, files and the check of what was written."""
