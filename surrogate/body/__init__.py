"""Bodies: families given by a few parameters in 2-D and 3-D, closed contours, their measures."""
