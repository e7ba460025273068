"""Training a network through the flow: samples, the loop that all methods share, their records."""
