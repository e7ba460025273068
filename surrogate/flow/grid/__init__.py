"""The discrete problem: staggered grid, Oseen Green's functions, immersed body and far field."""
