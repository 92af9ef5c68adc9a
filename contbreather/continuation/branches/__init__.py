"""Boundaries, switching and diagrams."""

from __future__ import annotations
