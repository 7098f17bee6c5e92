"""Measuring ARTO: `python -m bench --help`."""
