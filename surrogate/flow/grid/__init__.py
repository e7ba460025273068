"""The discrete stream: staggered grid, Oseen Green's function, immersed body, far field."""
