"""Depth cameras that fail like real ones: from what is there to what they report."""
