"""What is asked for: an objective to be least, constraints on the body, and what contradicts."""
