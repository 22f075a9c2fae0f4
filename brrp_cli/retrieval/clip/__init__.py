"""CLIP: P(c|R) from the crop of an object and the stored phrases."""
