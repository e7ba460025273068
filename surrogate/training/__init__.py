"""Training of drag networks with the flow solver; README.md here has the equations."""
