"""Retrieval: P(c|R), the probability of each stored object given the image."""
