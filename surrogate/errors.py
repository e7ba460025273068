"""Exceptions of the library; commands turn them into exit statuses 2 and 3."""


class InvalidInput(ValueError):
    """The exception for a wrong argument; its message says which, and what would be right."""


class TooLarge(InvalidInput):
    """The exception for a body that is too large for the computational domain."""


class NotConverged(RuntimeError):
    """The exception for a solver that has not reached its tolerance, so that there is no result."""
