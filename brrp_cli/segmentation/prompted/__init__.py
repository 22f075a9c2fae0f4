"""Masks by a phrase: a detector finds boxes, a segmenter cuts them out (Grounded SAM)."""
