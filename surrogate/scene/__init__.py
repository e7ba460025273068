"""What is modelled: stream, Reynolds numbers, bodies, fidelity, and what that will cost."""
