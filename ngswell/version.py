"""The version of ngswell."""

__version__ = "0.1.0"
