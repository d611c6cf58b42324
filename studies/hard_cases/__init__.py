"""Families of hard cases: each passes with its error or ends with a reason."""
