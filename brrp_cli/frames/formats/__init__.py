"""One file for each format that frames come in; each defines `FORMAT`, and that is all it takes."""
