"""Boundaries, switching and diagrams."""
