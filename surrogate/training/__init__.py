"""Training of networks of the loads with the flow solver; README.md here has the equations."""
