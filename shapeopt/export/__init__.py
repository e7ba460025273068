"""A body for other programs: contour, loads and solid, in files."""
