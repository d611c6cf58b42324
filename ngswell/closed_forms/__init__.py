"""Closed forms and series to compare with."""
