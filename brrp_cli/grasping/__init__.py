"""Parallel-jaw grasps of reconstructed objects, and how probably they hold."""
