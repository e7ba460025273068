"""Exceptions of the library; commands turn them into exit statuses 2 and 3."""


class InvalidInput(ValueError):
    """An argument is wrong; the message says which, and what would be right."""


class NotConverged(RuntimeError):
    """A solver has not reached its tolerance, so that there is no result."""
