"""How many of some cases hold, without those that can no longer decide it."""

from itertools import islice


def at_least(number, cases):
    """Return whether so many of the cases are true; those after the last one needed are not computed."""
    return len(list(islice(filter(None, cases), number))) == number
