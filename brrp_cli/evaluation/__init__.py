"""Evaluation: metrics against known truth."""
