"""The search for an optimum, on a surrogate or managed on the flow, and its verification."""
