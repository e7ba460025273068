"""Training methods: differentiable physics, scale-invariant, half-inverse, supervised."""
