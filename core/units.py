"""Times and sizes in few words, for messages and panels."""

from __future__ import annotations


def clock(seconds: float) -> str:
    """Put a duration into few words.

    Parameters
    ----------
    seconds : float
        The duration in seconds.

    Returns
    -------
    str

    Examples
    --------
    >>> clock(45), clock(200), clock(7500)
    ('45 s', '3 min 20 s', '2 h 5 min')
    """
    seconds = round(seconds)
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60} min"


def size(number: float) -> str:
    """Put a number of bytes into few words, in megabytes or gigabytes of 10^6 and 10^9 bytes.

    Parameters
    ----------
    number : float
        The number of bytes.

    Returns
    -------
    str

    Examples
    --------
    >>> size(3_900_000_000), size(25e6)
    ('3.9 GB', '25 MB')
    """
    return f"{number / 1e9:.1f} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
