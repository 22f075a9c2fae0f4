"""What tools/fuzz.py throws bytes at, and what it begins with."""
