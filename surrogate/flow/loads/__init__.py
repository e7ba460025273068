"""What the stream does to a body: force coefficients, pressure and friction on its surface."""
