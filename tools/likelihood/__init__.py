"""Parts of `tools/fit_likelihood.py`."""
