"""Whether training pays: what designs cost by each way, and when the bills cross."""
