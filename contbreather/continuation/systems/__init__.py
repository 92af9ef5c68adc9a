"""Defining systems, branch points and normal forms."""
