"""Models of the loads: the network, a trained surrogate, its record and folder; kriging."""
