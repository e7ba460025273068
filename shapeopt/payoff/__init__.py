"""Whether training pays: what designs cost by each strategy, and after how many it breaks even."""
