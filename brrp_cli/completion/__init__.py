"""The unseen side of an object that no stored one explains."""
