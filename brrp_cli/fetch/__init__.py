"""Files from elsewhere: brought whole, checked, or not at all."""
