"""The two ways a request can fail; scripts turn them into exit statuses 2 and 3."""


class InvalidInput(ValueError):
    """The request itself is wrong; the message says what, and what would be right."""


class NotConverged(RuntimeError):
    """A solve did not reach its tolerance, so there is no number to return."""
