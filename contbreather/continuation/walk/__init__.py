"""Continuation: starts, steps and where they end."""
