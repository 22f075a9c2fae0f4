"""What an object looks like, in numbers: colour, shape and metric size of a visible side."""
