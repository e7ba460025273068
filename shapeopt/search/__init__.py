"""The search for the best body, by a surrogate or by the flow, and its verification."""
