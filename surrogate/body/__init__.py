"""Bodies: a family given by a few sine modes, any closed contour, and what is measured on them."""
