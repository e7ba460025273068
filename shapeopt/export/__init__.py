"""Files of a body for other programs."""
