"""Shapes drawn at random: household shapes of random dimensions, and solids of no kind."""
