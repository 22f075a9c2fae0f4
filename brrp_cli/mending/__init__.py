"""Masks mended by what is recognised, and what they change reconstructed again."""
