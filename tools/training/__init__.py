"""Training of networks from made scenes."""
